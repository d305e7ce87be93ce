"""Who turns for a target at the side, the neck or the eyes: the three ways of thesis 6.5.3."""

import math
from dataclasses import dataclass

from medusa.kinematics import Joints


@dataclass(frozen=True)
class EyesFirst:
    """(i): the eyes follow; when their version exceeds `comfort` [rad], pan takes it all over in one fast movement."""

    comfort: float = math.radians(15)

    def pan(self, pan: float, azimuth: float) -> float:
        return pan

    def wants_neck_saccade(self, pan: float, azimuth: float) -> bool:
        return abs(azimuth - pan) > self.comfort


@dataclass(frozen=True)
class NeckFollows:
    """(ii): pan keeps the gaze angle at 90°, the eyes stay symmetric (for "pan and tilt" read vergence)."""

    def pan(self, pan: float, azimuth: float) -> float:
        return azimuth

    def wants_neck_saccade(self, pan: float, azimuth: float) -> bool:
        return False


@dataclass(frozen=True)
class SharedEffort:
    """(iii): pan's share minimises effort and discomfort together.

    With a turn δ of the pan and a version φ − δ left for the eyes (φ: azimuth seen from the present pan), the
    cost w_pan δ² + w_comfort (φ − δ)² is least at δ = φ w_comfort/(w_pan + w_comfort).
    """

    pan_effort: float = 4.0
    discomfort: float = 1.0

    def pan(self, pan: float, azimuth: float) -> float:
        return pan + (azimuth - pan) * self.discomfort / (self.pan_effort + self.discomfort)

    def wants_neck_saccade(self, pan: float, azimuth: float) -> bool:
        return False


Coordination = EyesFirst | NeckFollows | SharedEffort
COORDINATIONS: dict[str, Coordination] = {"i": EyesFirst(), "ii": NeckFollows(), "iii": SharedEffort()}


def eyes_after_pan(left: float, right: float, turn: float) -> tuple[float, float]:
    """Eye angles that keep the fixation point when the pan turns by `turn` [rad], tilt level.

    The point of the two lines of sight, in units of the baseline, is turned back by the pan about the
    baseline's midpoint; (6.27) is the case turn = θ_g − π/2. Axes that do not meet ahead fixate infinity:
    both eyes then turn back by the pan.
    """
    vergence = right - left
    if vergence < 1e-6:
        return left - turn, right - turn
    reach = math.cos(right) / math.sin(vergence)
    forward, lateral = reach * math.cos(left), 0.5 + reach * math.sin(left)
    c, s = math.cos(turn), math.sin(turn)
    forward, lateral = c * forward + s * lateral, -s * forward + c * lateral
    return math.atan2(lateral - 0.5, forward), math.atan2(lateral + 0.5, forward)


def gaze_azimuth(joints: Joints) -> float:
    """Azimuth of the fixation point from the baseline's midpoint [rad]: (6.26) from straight ahead."""
    return joints.pan + math.atan((math.tan(joints.left) + math.tan(joints.right)) / 2)


def coordinate(way: Coordination, joints: Joints, *, at_once: bool = False) -> Joints:
    """Share the horizontal part of desired joint angles between pan and eyes, the fixation point kept.

    The azimuth is that of the fixation point from the baseline's midpoint, (6.26) from straight ahead: pan +
    version to first order, exactly atan2 of the point. `at_once` hands all of it to the pan, (6.27).
    """
    azimuth = gaze_azimuth(joints)
    pan = azimuth if at_once else way.pan(joints.pan, azimuth)
    left, right = eyes_after_pan(joints.left, joints.right, pan - joints.pan)
    return Joints(pan, joints.tilt, left, right)
