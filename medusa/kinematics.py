"""Where the two eyes look, and which joint angles make them look there.

Head frame (REP-103): x forward, y left, z up, origin where the tilt axis crosses the pan axis. The chain is
pan about z (positive left), tilt about y (positive down), then each eye about z (positive left) at y = ±b/2.
Image coordinates are tangents from the optical axis, x right and y down: a pixel minus the principal point
over the focal length in pixels.

The thesis's simplified kinematics (6.24)–(6.27) stand at the end; its vergence angles θ are counter-clockwise
from the baseline (left eye to right eye), straight ahead = π/2, so θ = π/2 + (eye angle).
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

Vector = NDArray[np.float64]
Eye = Literal["left", "right"]
Tangents = tuple[float, float]

# Columns: the camera's x (right), y (down), z (forward) in the eye's frame (forward, left, up).
_CAMERA_IN_EYE = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])


class Joints(NamedTuple):
    """Joint angles [rad] or, where said, their rates [rad/s]."""

    pan: float
    tilt: float
    left: float
    right: float

    @property
    def version(self) -> float:
        """Mean of the two eyes, (left + right)/2 [rad]."""
        return (self.left + self.right) / 2

    @property
    def vergence(self) -> float:
        """Angle between the two optical axes, right − left, positive when they converge [rad]."""
        return self.right - self.left

    @classmethod
    def from_axes(cls, angles: Mapping[str, float]) -> "Joints":
        """From a mapping keyed by the head's axis names."""
        return cls(angles["pan"], angles["tilt"], angles["left_vergence"], angles["right_vergence"])

    def as_axes(self) -> dict[str, float]:
        """As a mapping keyed by the head's axis names."""
        return {"pan": self.pan, "tilt": self.tilt, "left_vergence": self.left, "right_vergence": self.right}


def eyes_from_version(version: float, vergence: float) -> tuple[float, float]:
    """Left and right eye angles of a version and a vergence, all [rad]."""
    return version - vergence / 2, version + vergence / 2


@dataclass(frozen=True)
class HeadGeometry:
    """Baseline [m], and each optical centre's place from its vergence axis, (forward, left, up) [m], in the eye."""

    baseline: float
    left_centre: tuple[float, float, float] = (0.0, 0.0, 0.0)
    right_centre: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def offset(self, eye: Eye) -> tuple[float, float, float]:
        return self.left_centre if eye == "left" else self.right_centre


def _about_z(angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _about_y(angle: float) -> Vector:
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def camera_pose(geometry: HeadGeometry, joints: Joints, eye: Eye) -> tuple[Vector, Vector]:
    """Rotation (3, 3) camera → head frame and optical centre (3,) [m] in the head frame."""
    neck = _about_z(joints.pan) @ _about_y(joints.tilt)
    side, turn = (1.0, joints.left) if eye == "left" else (-1.0, joints.right)
    orientation = neck @ _about_z(turn)
    centre = neck @ np.array([0.0, side * geometry.baseline / 2, 0.0]) + orientation @ np.array(
        geometry.offset(eye)
    )
    return orientation @ _CAMERA_IN_EYE, centre


def project(geometry: HeadGeometry, joints: Joints, eye: Eye, point: Vector) -> Tangents:
    """Tangents (x right, y down) at which an eye sees a point (3,) [m] of the head frame; NaN when behind it."""
    rotation, centre = camera_pose(geometry, joints, eye)
    x, y, z = rotation.T @ (np.asarray(point, float) - centre)
    return (float(x / z), float(y / z)) if z > 0 else (math.nan, math.nan)


def line_of_sight(
    geometry: HeadGeometry, joints: Joints, eye: Eye, tangents: Tangents
) -> tuple[Vector, Vector]:
    """Optical centre (3,) [m] and unit direction (3,) in the head frame of what is seen at these tangents."""
    rotation, centre = camera_pose(geometry, joints, eye)
    direction = rotation @ np.array([tangents[0], tangents[1], 1.0])
    return centre, direction / np.linalg.norm(direction)


def triangulate(geometry: HeadGeometry, joints: Joints, left: Tangents, right: Tangents) -> Vector | None:
    """The point (3,) [m] midway between two lines of sight at their closest; None when they do not meet ahead."""
    a, u = line_of_sight(geometry, joints, "left", left)
    b, v = line_of_sight(geometry, joints, "right", right)
    w, c = a - b, float(u @ v)
    sine_squared = 1.0 - c * c
    if sine_squared < 1e-12:
        return None
    along_left = (c * float(v @ w) - float(u @ w)) / sine_squared
    along_right = (float(v @ w) - c * float(u @ w)) / sine_squared
    if along_left <= 0 or along_right <= 0:
        return None
    return (a + along_left * u + b + along_right * v) / 2


def look_at(geometry: HeadGeometry, point: Vector, pan: float) -> Joints:
    """Tilt and eye angles that put a point (3,) [m] of the head frame on both optical axes, for a given pan
    [rad].

    Exact for optical centres on the axes or moved forward, left or up from them (both up by the mean of the
    two). Raises ValueError for a point nearer to an axis than the optical centre's offset from it.
    """
    x, y, z = _about_z(-pan) @ np.asarray(point, float)
    up = (geometry.left_centre[2] + geometry.right_centre[2]) / 2
    reach = math.hypot(x, z)
    if reach <= abs(up):
        raise ValueError(
            f"a point {reach:.3f} m from the tilt axis cannot be looked at with centres {up:.3f} m above it"
        )
    tilt = math.atan2(-z, x) + math.asin(up / reach)
    forward = x * math.cos(tilt) - z * math.sin(tilt)
    eyes = []
    for side, offset in ((1.0, geometry.left_centre), (-1.0, geometry.right_centre)):
        lateral = y - side * geometry.baseline / 2
        distance = math.hypot(forward, lateral)
        if distance <= abs(offset[1]):
            raise ValueError(
                f"a point {distance:.3f} m from an eye's axis cannot be looked at past {offset[1]:.3f} m"
            )
        eyes.append(math.atan2(lateral, forward) - math.asin(offset[1] / distance))
    return Joints(pan, tilt, eyes[0], eyes[1])


def direction_of(azimuth: float, elevation: float) -> Vector:
    """Unit vector (3,) of an azimuth (positive left) and an elevation (positive down, like tilt) [rad]."""
    c = math.cos(elevation)
    return np.array([c * math.cos(azimuth), c * math.sin(azimuth), -math.sin(elevation)])


def bearing_of(point: Vector) -> tuple[float, float]:
    """Azimuth (positive left) and elevation (positive down) [rad] of a point or direction (3,)."""
    x, y, z = point
    return math.atan2(y, x), math.atan2(-z, math.hypot(x, y))


def image_jacobian(geometry: HeadGeometry, joints: Joints, point: Vector) -> Vector:
    """(4, 4): change of (x_l, y_l, x_r, y_r) [tangents] by (pan, tilt, left, right) [rad] of a point (3,)
    fixed in the head frame.

    A joint turning at ω about an axis n through a point o moves what the eye sees like −ω n × (p − o); the
    image follows from the projection's derivative (ẋ = (Ẋ − xŻ)/Z). Raises ValueError when the point is not
    in front of both eyes.
    """
    point = np.asarray(point, float)
    pan_frame = _about_z(joints.pan)
    tilt_frame = pan_frame @ _about_y(joints.tilt)
    jacobian = np.zeros((4, 4))
    for row, eye, side in ((0, "left", 1.0), (2, "right", -1.0)):
        rotation, centre = camera_pose(geometry, joints, eye)  # type: ignore[arg-type]
        seen = rotation.T @ (point - centre)
        if seen[2] <= 0:
            raise ValueError(f"the point is behind the {eye} eye")
        x, y, z = seen[0] / seen[2], seen[1] / seen[2], seen[2]
        projection = np.array([[1.0, 0.0, -x], [0.0, 1.0, -y]]) / z
        eye_axis_at = tilt_frame @ np.array([0.0, side * geometry.baseline / 2, 0.0])
        turns = (
            (0, np.array([0.0, 0.0, 1.0]), np.zeros(3)),
            (1, pan_frame[:, 1], np.zeros(3)),
            (2 if eye == "left" else 3, tilt_frame[:, 2], eye_axis_at),
        )
        for column, axis, at in turns:
            jacobian[row : row + 2, column] = projection @ rotation.T @ -np.cross(axis, point - at)
    return jacobian


def retinal_errors(
    left: Tangents | None, right: Tangents | None
) -> tuple[float | None, float | None, float | None]:
    """How far each eye and the tilt must turn to centre the target [rad]: thesis (6.24), (6.25), in the
    joints' signs.

    Left and right: −arctan x (eyes positive left, images positive right). Tilt: arctan of the mean of the y
    that were seen (positive down, both). None where nothing was seen.
    """
    seen = [eye[1] for eye in (left, right) if eye is not None]
    return (
        None if left is None else -math.atan(left[0]),
        None if right is None else -math.atan(right[0]),
        math.atan(sum(seen) / len(seen)) if seen else None,
    )


def gaze_angle(theta_left: float, theta_right: float) -> float:
    """Direction of the fixation point from the baseline's midpoint, θ_g [rad]: thesis (6.26).

    Printed as arctan(2 tan θ_vl tan θ_vr/(tan θ_vl + tan θ_vr)), whose principal value is wrong left of the
    head and 0/0 for parallel axes; implemented as atan2(2 sin θ_l sin θ_r, sin(θ_l + θ_r)). The pan saccade
    that faces the point is θ_g − π/2.
    """
    return math.atan2(2 * math.sin(theta_left) * math.sin(theta_right), math.sin(theta_left + theta_right))


def symmetric_vergence(theta_left: float, theta_right: float) -> tuple[float, float]:
    """Vergence angles (θ'_vl, θ'_vr) [rad] after a pan of θ_g − π/2 that keep the fixation point: thesis
    (6.27).

    θ'_vl = atan2(sin θ_l, sin(θ_g − θ_l)), θ'_vr = π − θ'_vl: the printed arctan is right in the first
    quadrant only.
    """
    turned = math.atan2(math.sin(theta_left), math.sin(gaze_angle(theta_left, theta_right) - theta_left))
    return turned, math.pi - turned
