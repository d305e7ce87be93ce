"""Views of a calibration board: from cameras before which it is turned by hand, or from a head that moves."""

import asyncio
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from medusa.calibration.head_geometry import EyeView, HeadView
from medusa.head.joint_group import JointGroup
from medusa.kinematics import Joints
from perception.camera.calibration import BoardView, CalibrationBoard
from perception.camera.errors import CameraError
from perception.camera.frame import Camera, Frame
from perception.camera.intrinsics import Intrinsics
from perception.camera.pairing import FramePair, paired

Tell = Callable[[str], None]
NEW_VIEW_PX = 12.0
"""A board held by hand counts as another view when its corners have moved so far on average."""
AT_REST_S = 0.15


@dataclass(frozen=True, eq=False)
class Posture:
    """Joint angles of the head at rest, and what each eye saw of the board then."""

    joints: Joints
    left: BoardView | None
    right: BoardView | None


def postures(count: int, *, pan: float, tilt: float, version: float, vergence: float) -> list[Joints]:
    """Joint angles that spread evenly over ±pan, ±tilt, ±version and 0..vergence [rad], deterministic.

    A Kronecker sequence: each coordinate runs through its range by another irrational step.
    """
    steps = np.sqrt([2.0, 3.0, 5.0, 7.0]) % 1.0
    places = (np.outer(np.arange(1, count + 1), steps) + 0.5) % 1.0
    found = []
    for p, t, v, g in places:
        turn, apart = (2.0 * v - 1.0) * version, g * vergence
        found.append(
            Joints((2.0 * p - 1.0) * pan, (2.0 * t - 1.0) * tilt, turn - apart / 2, turn + apart / 2)
        )
    return found


async def collect_postures(
    head: JointGroup,
    cameras: tuple[Camera, Camera],
    board: CalibrationBoard,
    wanted: Sequence[Joints],
    tell: Tell,
) -> list[Posture]:
    """Move to each posture and look at the board from it, at rest."""
    seen = []
    for number, target in enumerate(wanted, start=1):
        await head.move(target.as_axes())
        await asyncio.sleep(AT_REST_S)
        pair = await _next_pair(cameras, asyncio.get_running_loop().time())
        reading = await head.read()
        joints = Joints.from_axes({name: joint.angle for name, joint in reading.joints.items()})
        left, right = (None if f is None else board.find(f.image) for f in (pair.left, pair.right))
        seen.append(Posture(joints, left, right))
        corners = [0 if view is None else len(view.points) for view in (left, right)]
        tell(f"posture {number} of {len(wanted)}: {corners[0]} and {corners[1]} corners")
    return seen


async def _next_pair(cameras: tuple[Camera, Camera], since: float) -> FramePair:
    async for pair in paired(*cameras, bound=0.02, patience=0.2):
        if pair.stamp > since and pair.left is not None and pair.right is not None:
            return pair
    raise CameraError("the cameras have ended")


async def collect_by_hand(
    camera: Camera, board: CalibrationBoard, count: int, seconds: float, tell: Tell
) -> list[BoardView]:
    """Different views of a board that somebody turns before one camera; as many as came within the time."""
    views: list[BoardView] = []
    try:
        async with asyncio.timeout(seconds):
            async for frame in camera.frames():
                found = await asyncio.to_thread(board.find, _grey(frame))
                if found is not None and all(_differs(found, view) for view in views):
                    views.append(found)
                    tell(f"{camera.name}: view {len(views)} of {count}, {len(found.points)} corners")
                    if len(views) == count:
                        break
    except TimeoutError:
        tell(f"{camera.name}: {seconds:g} s are over with {len(views)} of {count} views")
    return views


def head_views(seen: Sequence[Posture], lenses: tuple[Intrinsics, Intrinsics]) -> list[HeadView]:
    """The postures with pixels turned into tangents."""

    def tangents(view: BoardView | None, lens: Intrinsics) -> EyeView | None:
        return None if view is None else EyeView(view.points, lens.rays(view.pixels))

    return [HeadView(p.joints, tangents(p.left, lenses[0]), tangents(p.right, lenses[1])) for p in seen]


def _differs(view: BoardView, other: BoardView) -> bool:
    places = {tuple(point): pixel for point, pixel in zip(other.points, other.pixels, strict=True)}
    moved = [
        math.dist(pixel, places[key])
        for point, pixel in zip(view.points, view.pixels, strict=True)
        if (key := tuple(point)) in places
    ]
    return not moved or float(np.mean(moved)) > NEW_VIEW_PX


def _grey(frame: Frame) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
    return frame.image if frame.image.ndim == 2 else frame.image[:, :, 1]
