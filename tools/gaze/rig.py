"""The emulated head before changing surroundings: homed once, then any number of tracking runs, with the truth."""

import asyncio
import math
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from medusa.config.file import parse_config
from medusa.gaze.report.track_log import TrackLog
from medusa.gaze.retina import Detector, Retina
from medusa.gaze.run.loop import Gaze, GazeLoop, LoopSettings, gaze_limits, least_speeds
from medusa.head.joint_group import JointGroup
from medusa.ideal.config import IdealConfig, template
from medusa.ideal.drive import IdealDrive
from medusa.kinematics import HeadGeometry, Joints, bearing_of, camera_pose, look_at
from medusa.mc3000.config import Mc3000Config
from medusa.simulation import SimulatedHead, simulated_cameras, simulated_head
from perception.camera.intrinsics import Intrinsics
from perception.target import Target, detect_bright_target
from sim_devices.camera import Picture
from sim_devices.stereo import StereoWorld
from sim_devices.worlds.config import WorldConfig

Array = NDArray[np.float64]
TRUTH_PERIOD = 0.02
THRESHOLD = 200
LOST_SECONDS = 1.0


@dataclass
class Run:
    """One run: truth every 20 ms, and the loop's own log. Angles in radians, times from the start of the path."""

    times: Array
    target: Array
    joints: list[Joints]
    geometry: HeadGeometry
    log: TrackLog
    start: float
    pictures: dict[str, list[Picture]] = field(default_factory=dict)

    def eye_errors(self) -> Array:
        """True angle (n, 2) between each optical axis, left and right, and the target."""
        errors = np.empty((len(self.times), 2))
        for k, (joints, point) in enumerate(zip(self.joints, self.target, strict=True)):
            for e, eye in enumerate(("left", "right")):
                rotation, centre = camera_pose(self.geometry, joints, eye)  # type: ignore[arg-type]
                x, y, z = rotation.T @ (point - centre)
                errors[k, e] = math.atan2(math.hypot(x, y), z)
        return errors

    def vergence_errors(self) -> Array:
        """True vergence minus the one that would fixate the target, (n,)."""
        wanted = [
            look_at(self.geometry, p, q.pan).vergence for p, q in zip(self.target, self.joints, strict=True)
        ]
        difference: Array = np.array([q.vergence for q in self.joints]) - np.array(wanted)
        return difference

    def target_azimuth(self) -> Array:
        """Azimuth of the target from the head's axis (n,), positive left."""
        return np.array([bearing_of(point)[0] for point in self.target])

    def gaze_azimuth(self) -> Array:
        """Pan plus version (n,)."""
        return np.array([q.pan + q.version for q in self.joints])

    def figures(self, since: float) -> dict[str, float | bool | int | None]:
        """True RMS, median and peak of the worse eye after ``since`` s, in degrees; lost or not."""
        worse = np.degrees(self.eye_errors().max(axis=1)[self.times >= since])
        vergence = np.degrees(np.abs(self.vergence_errors()[self.times >= since]))
        return {
            "rms_deg": float(np.sqrt(np.mean(worse**2))),
            "median_deg": float(np.median(worse)),
            "peak_deg": float(worse.max()),
            "vergence_median_deg": float(np.median(vergence)),
            "saccades": sum(begin >= self.start + since for begin, _, _ in self.log.saccades),
            "lost": self.lost(since),
        }

    def lost(self, since: float) -> bool:
        """Whether the target was unseen for over a second at a stretch, or in the end."""
        seen = [
            row.stamp - self.start for row in self.log.rows if row.left is not None or row.right is not None
        ]
        marks = [since, *(s for s in seen if s >= since), float(self.times[-1])]
        return bool(max(np.diff(marks)) > LOST_SECONDS + 1e-6) or len(marks) == 2


class Rig:
    """A homed head; ``run`` puts it before a world and lets a gaze follow the target.

    ``joint_angles``: the true angles (rad) by joint at a moment on the loop's clock. ``simulation``: the emulated
    head, None for an ideal one.
    """

    def __init__(
        self,
        head: JointGroup,
        joint_angles: Callable[[float], dict[str, float]],
        simulation: SimulatedHead | None = None,
    ) -> None:
        self.head = head
        self.joint_angles = joint_angles
        self._simulation = simulation
        self.limits = gaze_limits(head.traits)
        self.least_speeds = least_speeds(head.traits)

    @property
    def simulation(self) -> SimulatedHead:
        """The emulated head; ValueError for an ideal one."""
        if self._simulation is None:
            raise ValueError("an ideal head has no emulator")
        return self._simulation

    async def run(
        self,
        world: WorldConfig,
        make_gaze: Callable[["Rig", HeadGeometry], Gaze],
        seconds: float,
        *,
        start: Joints | None = None,
        detectors: tuple[Detector, Detector] | None = None,
        settings: LoopSettings | None = None,
        still: bool = False,
        keep_pictures: bool = False,
        stage: Callable[[StereoWorld, asyncio.AbstractEventLoop], None] | None = None,
        geometry: HeadGeometry | None = None,
    ) -> Run:
        """Follow for so long; the head begins at ``start``, or looking at the target.

        ``still`` holds the head instead; ``stage`` is called when the path begins, to plan incidents;
        ``geometry`` is what the gaze believes of the head (the truth when None).
        """
        loop = asyncio.get_running_loop()
        surroundings = StereoWorld(world, self.joint_angles)
        true_geometry = _geometry(surroundings)
        surroundings.world.epoch = math.inf  # nothing moves before the start
        begin = start
        if begin is None:
            point = surroundings.target_position(0.0)
            begin = self.limits.confine(look_at(true_geometry, point, 0.0))[0] if point is not None else None
        if begin is not None:
            await self.head.move(begin.as_axes())
        lens = surroundings.optics
        intrinsics = Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy)
        eyes = detectors or (bright, bright)
        pictures: dict[str, list[Picture]] = {"left": [], "right": []}
        if keep_pictures:
            for side, camera in surroundings.cameras.items():
                camera.deliver_to(pictures[side].append)
        async with simulated_cameras(surroundings) as cameras:
            gaze = make_gaze(self, geometry or true_geometry)
            retina = Retina(intrinsics, intrinsics, *eyes)
            gaze_loop = GazeLoop(self.head, cameras, retina, gaze, settings)
            began = loop.time()
            surroundings.power_up(began)
            if stage is not None:
                stage(surroundings, loop)
            truth = asyncio.create_task(self._witness(surroundings, began, seconds))
            try:
                if still:
                    await asyncio.sleep(seconds)
                    log = gaze_loop.log
                else:
                    log = await gaze_loop.run(seconds)
                times, target, joints = await truth
            finally:
                truth.cancel()
                with suppress(asyncio.CancelledError):
                    await truth
        return Run(times, target, joints, true_geometry, log, began, pictures)

    async def _witness(
        self, world: StereoWorld, began: float, seconds: float
    ) -> tuple[Array, Array, list[Joints]]:
        """The true target and joints every 20 ms, out of band."""
        loop = asyncio.get_running_loop()
        times, target, joints = [], [], []
        for k in range(round(seconds / TRUTH_PERIOD)):
            await asyncio.sleep(began + k * TRUTH_PERIOD - loop.time())
            now = loop.time()
            point = world.target_position(now)
            times.append(now - began)
            target.append(np.full(3, np.nan) if point is None else point)
            joints.append(Joints.from_axes(self.joint_angles(now)))
        return np.array(times), np.array(target), joints


def bright(image: NDArray[np.uint8]) -> Target | None:
    """The thesis's target: everything brighter than the threshold, at 64 columns."""
    return detect_bright_target(image, THRESHOLD)


def _geometry(world: StereoWorld) -> HeadGeometry:
    true = world.geometry
    return HeadGeometry(true.baseline, true.left.offset, true.right.offset)


@asynccontextmanager
async def open_rig(
    seed: int = 0, change: Callable[[Mc3000Config], Mc3000Config] | None = None
) -> AsyncIterator[Rig]:
    """An emulated head, enabled and homed, on the running loop."""
    async with simulated_head(seed) as simulation:
        config = simulation.config if change is None else change(simulation.config)
        async with simulation.open(config) as head:
            await head.enable()
            await head.home()
            yield Rig(head, simulation.machine.joint_angles, simulation)


@asynccontextmanager
async def open_ideal_rig() -> AsyncIterator[Rig]:
    """A head that follows its commands exactly, enabled and homed: the gaze without a chip."""
    config = parse_config(template(), "the ideal head's template")
    assert isinstance(config, IdealConfig)
    drive = IdealDrive(config.traits, watchdog=config.watchdog_ms / 1000)
    async with JointGroup.open(drive) as head:
        await head.home()
        yield Rig(head, lambda now: {name: drive.machine.angle(name, now) for name in drive.traits})
