"""The head's surroundings as a part of the bench: the world, both cameras, and their faults."""

from collections.abc import Callable, Mapping, Sequence
from math import radians
from typing import Any

import numpy as np

from sim_devices.camera import Sensor, SimulatedCamera
from sim_devices.chain import HeadGeometry, Mount, Side, optical_frame
from sim_devices.link.line import Device
from sim_devices.worlds.config import CamerasConfig, WorldConfig
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.rooms import make_world
from sim_devices.worlds.surface import hidden_between

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


class StereoWorld:
    """What both eyes see: part of the bench without a line, with its own verbs.

    ``joint_angles(t)`` gives the true joint angles, rad; it is asked at each exposure.
    """

    def __init__(self, config: WorldConfig, joint_angles: JointAngles, *, seed: int = 0) -> None:
        self.config = config
        self.world, self.target = make_world(config.target, seed=config.seed + seed, light=config.light)
        self.geometry = head_geometry(config.cameras)
        cameras = config.cameras
        self.optics = Optics.centred_deg(cameras.width, cameras.height, cameras.field_of_view_deg)
        sensor = Sensor(
            rate=cameras.rate_hz,
            exposure=cameras.exposure_ms * 1e-3,
            blur_samples=cameras.blur_samples,
            gain=cameras.gain,
            vignette=cameras.vignette,
            noise=cameras.noise,
            latency=cameras.latency_ms * 1e-3,
            drop=cameras.drop,
        )
        self._joint_angles = joint_angles
        self.cameras: dict[Side, SimulatedCamera] = {
            side: SimulatedCamera(
                side, self.world, self.optics, sensor, self._pose(side), seed=config.seed + seed
            )
            for side in SIDES
        }
        self.verbs: Mapping[str, Callable[..., Any]] = {
            "lights": self.lights,
            "hide": self.hide,
            "camera": self.camera,
            "delay": self.delay,
        }
        self._now = 0.0

    def power_up(self, t: float) -> None:
        """The paths begin here."""
        self.world.epoch = self._now = t

    def lines(self) -> Mapping[str, Sequence[Device]]:
        """No device hangs on a line here."""
        return {}

    def advance_to(self, t: float) -> None:
        """The time at which ``state`` looks and verbs act."""
        self._now = max(self._now, t)

    def state(self) -> dict[str, Any]:
        """Where the target is, the light, and how the cameras do."""
        position = self.target_position(self._now)
        return {
            "light": self.world.light,
            "target": None if position is None else position.tolist(),
            "cameras": {
                side: {"dead": c.dead, "delay": c.delay, "exposures": c.sequence}
                for side, c in self.cameras.items()
            },
        }

    def target_position(self, t: float) -> np.ndarray[Any, np.dtype[np.float64]] | None:
        """The true middle of the target at ``t``, metres in the head's axes; None without a target."""
        if self.target is None:
            return None
        return self.target.motion(self.world.elapsed(t)).position

    def pose(self, side: Side, t: float) -> Placement:
        """The true placement of an optical frame at ``t``."""
        return optical_frame(self.geometry, side, self._joint_angles(t))

    def start(self) -> None:
        """Both cameras begin to expose, together."""
        for camera in self.cameras.values():
            camera.start()

    def stop(self) -> None:
        """Both cameras stop."""
        for camera in self.cameras.values():
            camera.stop()

    def lights(self, level: float) -> None:
        """Set the light on everything that does not glow; 0 is lights out."""
        if not level >= 0.0:
            raise ValueError(f"light is {level}, must be 0 or more")
        self.world.light = level

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

    def camera(self, side: str, dead: bool) -> None:
        """Kill or revive the camera of one side."""
        self._camera(side).dead = dead

    def delay(self, side: str, seconds: float) -> None:
        """Deliver this side's pictures so much later."""
        if not seconds >= 0.0:
            raise ValueError(f"delay is {seconds} s, must be 0 or more")
        self._camera(side).delay = seconds

    def _camera(self, side: str) -> SimulatedCamera:
        for name, camera in self.cameras.items():
            if name == side:
                return camera
        raise ValueError(f"there is no {side!r} camera; there is left, right")

    def _pose(self, side: Side) -> Callable[[float], Placement]:
        return lambda t: self.pose(side, t)
