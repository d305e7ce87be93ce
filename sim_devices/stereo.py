"""The head's surroundings as a part of the bench: a rendered world with both eyes and a target."""

from collections.abc import Callable, Mapping
from math import radians
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim_devices.camera import Sensor, SimulatedCamera
from sim_devices.chain import HeadGeometry, Mount, Side, optical_frame
from sim_devices.rendered import RenderedWorld
from sim_devices.worlds.config import CamerasConfig, WorldConfig
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import Motion, Placement, still
from sim_devices.worlds.rooms import add_target, make_world
from sim_devices.worlds.surface import Surface, hidden_between
from sim_devices.worlds.world import World

JointAngles = Callable[[float], Mapping[str, float]]
SIDES: tuple[Side, Side] = ("left", "right")


def head_geometry(config: CamerasConfig) -> HeadGeometry:
    """Baseline and mounts from the configuration."""
    mounts = [
        Mount(offset, (radians(turn[0]), radians(turn[1]), radians(turn[2])))
        for offset, turn in (
            (config.left_offset_m, config.left_mount_deg),
            (config.right_offset_m, config.right_mount_deg),
        )
    ]
    return HeadGeometry(config.baseline_m, *mounts)


class StereoWorld(RenderedWorld):
    """What both eyes see: a room of the head's own, or another ``world`` with the head's target in it.

    ``joint_angles(t)`` gives the true joint angles, rad; it is asked at each exposure, as is ``stand(t)``,
    where the crossing of the head's axes stands: the origin, or on what carries the head.
    """

    def __init__(
        self,
        config: WorldConfig,
        joint_angles: JointAngles,
        *,
        seed: int = 0,
        stand: Motion | None = None,
        world: World | None = None,
    ) -> None:
        self._joint_angles = joint_angles
        self._stand = stand or still(Placement())
        self.config = config
        seed += config.seed
        self.target: Surface | None
        if world is None:
            world, self.target = make_world(config.target, seed=seed, light=config.light)
        else:
            self.target = add_target(world, config.target, seed=seed, about=self._stand(0.0))
        super().__init__(world)
        self.verbs = {**self.verbs, "hide": self.hide}
        cameras = config.cameras
        self.geometry = head_geometry(cameras)
        self.optics = Optics.centred_deg(cameras.width, cameras.height, cameras.field_of_view_deg)
        sensor = Sensor.configured(cameras)
        for side in SIDES:
            camera = SimulatedCamera(side, world, self.optics, sensor, self._pose(side), seed=seed)
            self.mount(camera, cameras.port(side))

    def state(self) -> dict[str, Any]:
        """Where the target is, the light, and how the cameras do."""
        position = self.target_position(self._now)
        return {"target": None if position is None else position.tolist(), **super().state()}

    def target_position(self, t: float) -> NDArray[np.float64] | None:
        """The true middle of the target at ``t``, metres in the world's axes; None without a target."""
        if self.target is None:
            return None
        return self.target.motion(self.world.elapsed(t)).position

    def pose(self, side: Side, t: float) -> Placement:
        """The true placement of an optical frame at ``t``."""
        return self._stand(t) @ optical_frame(self.geometry, side, self._joint_angles(t))

    def hide(self, seconds: float) -> None:
        """Take the target away for so long, from now."""
        if not seconds > 0.0:
            raise ValueError(f"the target must be hidden for a positive time, not {seconds} s")
        if self.target is None:
            raise ValueError("this world has no target")
        index = self.world.surfaces.index(self.target)
        start = self.world.elapsed(self._now)
        shown = hidden_between(self.target.painting, start, start + seconds)
        hidden = type(self.target)(**{**vars(self.target), "painting": shown})
        self.world.surfaces[index] = self.target = hidden

    def _pose(self, side: Side) -> Motion:
        return lambda t: self.pose(side, t)
