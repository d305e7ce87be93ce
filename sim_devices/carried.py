"""Cameras on carriers: each exposes where its carrier truly is, whatever that believes of itself."""

from collections.abc import Mapping
from math import cos, radians, sin
from typing import Any

import numpy as np

from sim_devices.camera import Sensor, SimulatedCamera
from sim_devices.labmate import BaseMachine
from sim_devices.worlds.config import CarriedCameraConfig
from sim_devices.worlds.placement import Motion, Placement, facing, mounted, rotation_about
from sim_devices.worlds.plan import Mount
from sim_devices.worlds.walls import carrier_of
from sim_devices.worlds.world import World

EYE_RADIUS, EYE_ANGLE = 0.34, radians(72.0)
"""Polar coordinates of the right eye on the base (thesis 3.3.2): ρ sin θ ahead and ρ cos θ aside (its Ẋ, Ẏ)."""
EYE_HEIGHT = 0.35
"""Ours: just above the body."""


def side_eyes(**changes: Any) -> tuple[CarriedCameraConfig, CarriedCameraConfig]:
    """The two eyes of chapter 3 on "base", "left" and "right", with optical axes straight to the sides.

    256 x 256 pixels, f = 192 pixels, 12.5 Hz, noise of 2 grey levels; ``changes`` replace fields of both.
    """
    forward, aside = EYE_RADIUS * sin(EYE_ANGLE), EYE_RADIUS * cos(EYE_ANGLE)
    left, right = (
        CarriedCameraConfig(
            **{
                "name": name,
                "mount": Mount(on="base", x=forward, y=sign * aside, z=EYE_HEIGHT, yaw_deg=sign * 90.0),
                "rate_hz": 12.5,
                "noise": 2.0,
                **changes,
            }
        )
        for name, sign in (("left", 1.0), ("right", -1.0))
    )
    return left, right


def motion_of(machine: BaseMachine) -> Motion:
    """The true placement of a base's axes on the floor, at times of the loop's clock in their order."""

    def at(t: float) -> Placement:
        x, y, heading = machine.pose(t)
        return Placement(rotation_about(2, heading), np.array([x, y, 0.0]))

    return at


def carried_camera(
    config: CarriedCameraConfig, world: World, carriers: Mapping[str, Motion], *, seed: int = 0
) -> SimulatedCamera:
    """A camera on its carrier; raises ValueError when there is no such carrier."""
    carrier = carrier_of(config.mount.on, carriers, f"camera {config.name!r}: mount.on")
    # Optical axes: x right, y down, z ahead of someone who looks along the mount's x.
    eye = config.true_mount.placement() @ facing((0.0, 0.0, 0.0))
    return SimulatedCamera(
        config.name,
        world,
        config.true_optics,
        Sensor.configured(config),
        mounted(carrier, eye),
        seed=seed,
        window=config.part,
    )
