"""An emulated head behind pseudo-terminals, in this process: what `--sim` and the tests talk to."""

from __future__ import annotations

import math
import tempfile
from collections.abc import AsyncIterator, Coroutine
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from medusa.errors import CommandError
from medusa.kinematics import HeadGeometry
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.simulated_config import simulated_config

if TYPE_CHECKING:
    import numpy as np
    from numpy.typing import NDArray

    from medusa.head.joint_group import JointGroup
    from medusa.link import Trace
    from perception.camera.intrinsics import Intrinsics
    from perception.camera.slot import SlotCamera
    from sim_devices.bench import Bench, Part
    from sim_devices.head import HeadMachine
    from sim_devices.stereo import StereoWorld
    from sim_devices.worlds.config import WorldConfig

T = TypeVar("T")

PORT_NAME = "simulated"
"""In place of the port in the homing marks: a pseudo-terminal's path differs from run to run."""


@dataclass(frozen=True)
class SimulatedHead:
    """The emulated head: its ports and the configuration for them; `machine` and `bench` only as witness."""

    boards: str
    amps: str
    config: Mc3000Config
    machine: HeadMachine
    bench: Bench
    seed: int | None
    world: StereoWorld | None = None

    def open(
        self, config: Mc3000Config | None = None, trace: Trace | None = None
    ) -> AbstractAsyncContextManager[JointGroup]:
        """Connect to it as to a real one; the same seed gives the same bytes."""
        from medusa.machines import open_head

        return open_head(
            config or self.config, self.boards, self.amps, trace=trace, port_name=PORT_NAME, seed=self.seed
        )

    def cameras(
        self, *, stall_after: float = 2.0
    ) -> AbstractAsyncContextManager[tuple[SlotCamera, SlotCamera]]:
        """The left and the right camera of the world, exposing; raises ValueError without a world."""
        if self.world is None:
            raise ValueError("simulated_head was started without a world: there is nothing to see")
        return simulated_cameras(self.world, stall_after=stall_after)

    def geometry(self) -> HeadGeometry:
        """What a perfect calibration of the head would say; raises ValueError without a world."""
        if self.world is None:
            raise ValueError("simulated_head was started without a world: it has no cameras")
        true = self.world.geometry
        return HeadGeometry(true.baseline, true.left.offset, true.right.offset)

    def target_patch(self) -> NDArray[np.uint8]:
        """The textured target as a picture of its own, at the size it has where it begins."""
        import cv2
        import numpy as np

        if self.world is None or self.world.target is None:
            raise ValueError("simulated_head was started without a target")
        config, lens = self.world.config.target, self.world.optics
        side = max(7, round(0.8 * config.size_m / config.distance_m.mean * lens.fx))
        texture = self.world.target.painting
        if callable(texture):
            raise ValueError("a screen has no patch of its own; follow its bright target")
        whole = texture.levels[0]
        margin = round(0.1 * whole.shape[0])
        middle = whole[margin : whole.shape[0] - margin, margin : whole.shape[1] - margin]
        return np.asarray(cv2.resize(middle, (side, side), interpolation=cv2.INTER_AREA), np.uint8)

    def intrinsics(self) -> Intrinsics:
        """What a perfect calibration of either camera would say; raises ValueError without a world."""
        from perception.camera.intrinsics import Intrinsics

        if self.world is None:
            raise ValueError("simulated_head was started without a world: it has no cameras")
        lens = self.world.optics
        return Intrinsics(lens.width, lens.height, lens.fx, lens.fy, lens.cx, lens.cy)


def simulated_surroundings(
    *, target: str, screen: str, pixels: int, rate: float, latency_ms: float
) -> WorldConfig:
    """A room with a lamp or a textured target, or `screen`'s pictures on a swinging screen, for `--sim`."""
    from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig

    if screen:
        seen = TargetConfig(
            kind="screen",
            pictures=screen,
            picture_rate_hz=rate,
            azimuth_deg=PathConfig(kind="sine", amplitude=15.0, frequency_hz=0.1),
            elevation_deg=PathConfig(),
            distance_m=PathConfig(mean=2.0),
        )
    elif target == "texture":
        seen = TargetConfig(kind="texture", size_m=0.3)
    else:
        seen = TargetConfig(kind="lamp", size_m=0.08)
    cameras = CamerasConfig(
        width=pixels,
        height=pixels,
        field_of_view_deg=60.0 if screen else 40.0,
        rate_hz=rate,
        latency_ms=latency_ms,
    )
    return WorldConfig(target=seen, cameras=cameras)


def simulated_board(
    stack: AsyncExitStack, picture: NDArray[np.uint8], size: tuple[float, float], rate: float
) -> WorldConfig:
    """A calibration board of `size` metres before the head, slanted by nobody's hand; for `--sim`.

    Its picture lives in a folder of its own until the stack ends.
    """
    import cv2

    from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig

    folder = stack.enter_context(tempfile.TemporaryDirectory(prefix="medusa-board-"))
    cv2.imwrite(str(Path(folder) / "board.png"), picture)
    distance = 0.55
    angles = (2.0 * math.degrees(math.atan(side / 2.0 / distance)) for side in size)
    board = TargetConfig(
        kind="screen",
        pictures=folder,
        screen_deg=(next(angles), next(angles)),
        azimuth_deg=PathConfig(),
        elevation_deg=PathConfig(),
        distance_m=PathConfig(mean=distance),
    )
    cameras = CamerasConfig(
        width=320, height=240, field_of_view_deg=50.0, rate_hz=rate, left_offset_m=(0.012, 0.0, 0.0),
        right_offset_m=(0.012, 0.0, 0.0), left_mount_deg=(0.4, -0.5, 0.8), right_mount_deg=(-0.3, 0.4, -0.6),
    )  # fmt: skip
    return WorldConfig(target=board, cameras=cameras)


@asynccontextmanager
async def simulated_cameras(
    world: StereoWorld, *, stall_after: float = 2.0
) -> AsyncIterator[tuple[SlotCamera, SlotCamera]]:
    """The left and the right camera of a rendered world, exposing while the context is open."""
    from perception.camera.frame import Frame
    from perception.camera.slot import SlotCamera

    left, right = SlotCamera("left", stall_after=stall_after), SlotCamera("right", stall_after=stall_after)
    async with left, right:
        ends = [
            source.deliver_to(
                lambda picture, into=into: into.put(  # type: ignore[misc]
                    Frame(picture.image, picture.stamp, into.name, picture.sequence)
                )
            )
            for source, into in zip(world.cameras.values(), (left, right), strict=True)
        ]
        world.start()
        try:
            yield left, right
        finally:
            world.stop()
            for end in ends:
                end()


@asynccontextmanager
async def simulated_head(
    seed: int | None = 0,
    config: Any = None,
    faults: Any = None,
    *,
    baud: int = 115200,
    world: Any = None,
) -> AsyncIterator[SimulatedHead]:
    """Start the emulators on the running loop.

    `config`: a `sim_devices.head_config.HeadConfig` (friction, backlash, bus voltage …), the pages' values when None;
    `faults`: a `FaultPlan` for both lines, or one for each of "mc3000" and "servo-amps"; `world`: a
    `sim_devices.worlds.config.WorldConfig`, what the head's cameras see (none without).
    """
    from sim_devices.bench import Bench
    from sim_devices.head import HeadMachine

    machine = HeadMachine(config, seed)
    parts: dict[str, Part] = {"head": machine}
    surroundings = None
    if world is not None:
        from sim_devices.stereo import StereoWorld

        try:
            surroundings = StereoWorld(world, machine.joint_angles, seed=seed or 0)
        except ValueError as error:
            raise CommandError(str(error)) from error
        parts["world"] = surroundings
    async with Bench(parts, seed=seed, baud=baud, faults=faults) as bench:
        yield SimulatedHead(
            bench.ports["mc3000"],
            bench.ports["servo-amps"],
            simulated_config(),
            machine,
            bench,
            seed,
            surroundings,
        )


def run_virtual(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end in virtual time, as asyncio.run does on the wall clock."""
    from sim_devices.clock import run_virtual as run

    return run(main)
