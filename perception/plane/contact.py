"""Time to contact with a plane and its orientation, when the camera's rotation is known and its speed is not."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.plane.plane_motion import PlaneMotion, tangent

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
ROUNDS = 4


@dataclass(frozen=True, eq=False)
class Contact:
    """A plane's motion as R + t qᵀ: t the way of one step, of length 1, and q = n/D in the first view, in 1/steps.

    A point P of the plane, qᵀP = 1, is at R P + t in the second view. n points away from the camera.
    """

    direction: Vector
    """t, 3 components."""
    plane: Vector
    """q, 3 components."""
    covariance: Matrix
    """Of (t, q), 6 × 6; of rank 5, for only t qᵀ is seen."""
    rotation: Matrix

    @property
    def approach(self) -> float:
        """Part of the distance to the plane that the step has covered, 1 − D₂/D₁; negative when it grows."""
        return float(-self.plane @ self.rotation.T @ self.direction)

    @property
    def approach_std(self) -> float:
        """Its standard deviation."""
        return self._deviation(
            np.concatenate((-self.rotation @ self.plane, -self.rotation.T @ self.direction))
        )

    @property
    def steps(self) -> float:
        """Time to contact: further steps of the same length until the camera meets the plane; ∞ when it goes away."""
        return 1 / self.approach - 1 if self.approach > 0 else float("inf")

    @property
    def steps_std(self) -> float:
        """Its standard deviation."""
        return self.approach_std / self.approach**2 if self.approach > 0 else float("inf")

    @property
    def slopes(self) -> tuple[float, float]:
        """γ_x, γ_y of Z = Z₀ + γ_x X + γ_y Y in the first view, thesis (4.4)."""
        return float(-self.plane[0] / self.plane[2]), float(-self.plane[1] / self.plane[2])

    @property
    def slopes_std(self) -> tuple[float, float]:
        """Their standard deviations."""
        x, y, z = self.plane
        zero = np.zeros(3)
        across, down = np.array([-1 / z, 0, x / z**2]), np.array([0, -1 / z, y / z**2])
        return (
            self._deviation(np.concatenate((zero, across))),
            self._deviation(np.concatenate((zero, down))),
        )

    def _deviation(self, gradient: Vector) -> float:
        return float(np.sqrt(max(float(gradient @ self.covariance @ gradient), 0.0)))


def estimate_contact(motion: PlaneMotion, camera: Intrinsics, rotation: Matrix | None = None) -> Contact:
    """The step's direction and the plane, from a motion and the camera's rotation R (P' = R P + t; none by default).

    Of H ~ K (R + t qᵀ) K⁻¹ the middle singular value of K⁻¹ H K, which is 1, gives the scale; the best R + t qᵀ is
    then found by least squares with the information of the motion.
    """
    known = np.eye(3) if rotation is None else np.asarray(rotation, float)
    k = camera.matrix
    seen = np.linalg.solve(k, motion.homography @ k)
    seen /= np.linalg.svd(seen, compute_uv=False)[1] * np.sign(np.linalg.det(seen))
    left, sizes, right = np.linalg.svd(seen - known)
    direction, plane = left[:, 0], sizes[0] * right[0]
    to_window = motion.window.from_pixels @ k
    for _ in range(ROUNDS):
        model = known + np.outer(direction, plane)
        changes = [np.outer(unit, plane) for unit in np.eye(3)] + [
            np.outer(direction, unit) for unit in np.eye(3)
        ]
        gain = _gain(motion, to_window, model, changes)
        update = gain @ motion.beyond(k @ model @ np.linalg.inv(k))
        direction, plane = direction + update[:3], plane + update[3:]
    length = float(np.linalg.norm(direction))
    if plane[2] < 0:
        length = -length
    scale = np.repeat((1 / length, length), 3)
    return Contact(
        direction / length,
        plane * length,
        scale[:, None] * (gain @ motion.covariance @ gain.T) * scale,
        known,
    )


def _gain(motion: PlaneMotion, to_window: Matrix, model: Matrix, changes: list[Matrix]) -> Matrix:
    """Least-squares parameters from δ, p × 8, for changes of the model in camera coordinates by each of them."""
    inside = to_window @ np.linalg.inv(model)
    outside = np.linalg.inv(to_window)
    jacobian = np.stack([tangent(inside @ change @ outside) for change in changes], axis=1)
    normal = jacobian.T @ motion.information @ jacobian
    return np.asarray(np.linalg.pinv(normal, rcond=1e-9, hermitian=True) @ jacobian.T @ motion.information)
