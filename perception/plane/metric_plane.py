"""The plane itself, in metres, when the camera's motion is known."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.plane.errors import PlaneError
from perception.plane.plane_motion import PlaneMotion, tangent

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
ROUNDS = 3


@dataclass(frozen=True, eq=False)
class MetricPlane:
    """qᵀP = 1 in the camera's frame (x right, y down, z forward): q = n/D in 1/m, with its covariance (3 × 3)."""

    q: Vector
    covariance: Matrix

    @classmethod
    def at(cls, normal: Vector, distance: float, std: float = 0.0) -> "MetricPlane":
        """The plane with this normal (away from the camera) and distance in m; each of q is known to `std`, 1/m.

        Raises:
            PlaneError: the distance is not positive or the normal is 0.
        """
        length = float(np.linalg.norm(normal))
        if not (distance > 0 and length > 0):
            raise PlaneError(
                f"a plane at {distance} m with normal {normal}: the distance must be above 0 m and the normal not 0"
            )
        return cls(np.asarray(normal, float) / (length * distance), std**2 * np.eye(3))

    @property
    def distance(self) -> float:
        """D: from the camera along the normal, m."""
        return float(1 / np.linalg.norm(self.q))

    @property
    def distance_std(self) -> float:
        """Its standard deviation, m."""
        along = self.q * self.distance**3
        return float(np.sqrt(along @ self.covariance @ along))

    @property
    def normal(self) -> Vector:
        """n, of length 1, away from the camera."""
        return self.q * self.distance

    def homography(self, camera: Intrinsics, motion: Motion) -> Matrix:
        """K (R + t qᵀ) K⁻¹: where the pixels of this view are in one after the motion; a prior for the estimator."""
        return plane_homography(camera, motion, self.q)

    def carried(self, motion: Motion) -> "MetricPlane":
        """The same plane in the frame after the motion: q' = R q/(1 + qᵀRᵀt)."""
        turned = motion.rotation @ self.q
        nearer = 1 + float(turned @ motion.translation)
        if nearer <= 0:
            raise PlaneError(f"a motion by {motion.distance} m through a plane at {self.distance} m")
        jacobian = (
            motion.rotation - np.outer(turned, motion.translation @ motion.rotation) / nearer
        ) / nearer
        return MetricPlane(turned / nearer, jacobian @ self.covariance @ jacobian.T)

    def fused(self, other: "MetricPlane") -> "MetricPlane":
        """Both as one, weighted by their information: the two must not have erred together."""
        first, second = np.linalg.inv(self.covariance), np.linalg.inv(other.covariance)
        covariance = np.linalg.inv(first + second)
        return MetricPlane(covariance @ (first @ self.q + second @ other.q), covariance)


@dataclass(frozen=True, eq=False)
class MeasuredPlane(MetricPlane):
    """A plane that was measured, in the first view, and how well the motion that was given explains what was seen."""

    disagreement: float = float("nan")
    """Root mean square of the five deviations that no plane explains, in their standard deviations: near 1 when the
    motion and the camera are as they were given."""


def plane_homography(camera: Intrinsics, motion: Motion, q: Vector) -> Matrix:
    """K (R + t qᵀ) K⁻¹ in pixels."""
    k = camera.matrix
    moved = motion.rotation + np.outer(motion.translation, q)
    return np.asarray(k @ moved @ np.linalg.inv(k))


def measure_plane(seen: PlaneMotion, camera: Intrinsics, motion: Motion) -> MeasuredPlane | None:
    """q = n/D of the plane whose motion was seen while the camera moved: H ~ K (R + t qᵀ) K⁻¹, by least squares.

    Returns:
        None when the camera did not move: no motion shows a distance.
    """
    if motion.distance == 0:
        return None
    k = camera.matrix
    to_window = seen.window.from_pixels @ k
    outside = np.linalg.inv(to_window)
    q = _start(np.asarray(np.linalg.solve(k, seen.homography @ k)), motion)
    for _ in range(ROUNDS):
        inside = to_window @ np.linalg.inv(motion.rotation + np.outer(motion.translation, q))
        changes = [np.outer(motion.translation, unit) for unit in np.eye(3)]
        jacobian = np.stack([tangent(inside @ change @ outside) for change in changes], axis=1)
        weighted = jacobian.T @ seen.information
        gain = np.linalg.solve(weighted @ jacobian, weighted)
        rest = seen.beyond(plane_homography(camera, motion, q))
        q = q + gain @ rest
    rest = rest - jacobian @ (gain @ rest)
    left = np.eye(8) - jacobian @ gain
    spread = np.linalg.pinv(left @ seen.covariance @ left.T, rcond=1e-9, hermitian=True)
    disagreement = float(np.sqrt(max(float(rest @ spread @ rest), 0.0) / 5))
    return MeasuredPlane(q, gain @ seen.covariance @ gain.T, disagreement)


def _start(seen: Matrix, motion: Motion) -> Vector:
    """q and the scale s of s A = R + t qᵀ by linear least squares."""
    unknown = np.concatenate((-seen.reshape(-1, 1), np.kron(motion.translation[:, None], np.eye(3))), axis=1)
    solution = np.linalg.lstsq(unknown, -motion.rotation.ravel(), rcond=None)[0]
    return np.asarray(solution[1:])
