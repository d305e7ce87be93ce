"""The head's kinematic chain: where the two optical frames stand for given joint angles.

World axes x forward, y left, z up; pan, tilt and both vergence axes meet in the plane of the baseline, whose
middle is the origin. Pan turns left about z, then tilt down about y, then each eye left about its own z.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from sim_devices.worlds.placement import Placement, rotation_about

Side = Literal["left", "right"]
BASELINE_RANGE = (0.060, 0.200)
_OPTICAL = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


@dataclass(frozen=True)
class Mount:
    """How a camera sits on its vergence axis.

    ``offset``: optical centre from the crossing of vergence and tilt axis, metres forward, left, up in the
    eye's axes. ``rotation``: roll, pitch (down), yaw (left) of the camera against the eye, rad.
    """

    offset: tuple[float, float, float] = (0.0, 0.0, 0.0)
    rotation: tuple[float, float, float] = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class HeadGeometry:
    """Baseline between the vergence axes (60 to 200 mm), and the two mounts."""

    baseline: float = 0.130
    left: Mount = field(default_factory=Mount)
    right: Mount = field(default_factory=Mount)

    def __post_init__(self) -> None:
        low, high = BASELINE_RANGE
        if not low <= self.baseline <= high:
            raise ValueError(f"the baseline can be set from {low} to {high} m, not {self.baseline} m")


def optical_frame(geometry: HeadGeometry, side: Side, joints: Mapping[str, float]) -> Placement:
    """Placement of one optical frame for ``pan, tilt, left_vergence, right_vergence`` in rad."""
    mount = geometry.left if side == "left" else geometry.right
    shift = geometry.baseline / 2.0 if side == "left" else -geometry.baseline / 2.0
    roll, pitch, yaw = mount.rotation
    neck = rotation_about(2, joints["pan"]) @ rotation_about(1, joints["tilt"])
    eye = neck @ rotation_about(2, joints[f"{side}_vergence"])
    seat = rotation_about(2, yaw) @ rotation_about(1, pitch) @ rotation_about(0, roll)
    position = neck @ np.array([0.0, shift, 0.0]) + eye @ np.array(mount.offset)
    return Placement(eye @ seat @ _OPTICAL, position)
