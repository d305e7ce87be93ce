"""Inverse perspective, thesis (4.22)–(4.35): the flow of the floor as a camera that looks straight down would see it.

The thesis's frames: image x left and y up from the principal point; H shares the camera's centre, x left, y forward,
z down. For ordinary images (x right, y down) both signs of x and y, u and v change.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
ACROSS = 0.2
"""A normal that lies less than this along the motion says nothing about it."""


@dataclass(frozen=True)
class InversePerspective:
    """From the image to the horizontal plane by ᴴR_C = R_y(−φ) R_x(ψ), (4.22); angles in rad, lengths in px.

    f_x = f_y = 1 with slopes over focal lengths is the virtual camera of (4.19): the flow is as constant as with the
    true ones.
    """

    tilt: float
    """ψ, about the camera's x axis."""
    pan: float = 0.0
    """φ, about its y axis."""
    fx: float = 1.0
    fy: float = 1.0

    @classmethod
    def from_slopes(
        cls, slope_x: float, slope_y: float, fx: float = 1.0, fy: float = 1.0
    ) -> "InversePerspective":
        """ψ = −arctan γ_y, φ = −arctan(γ_x cos ψ), (4.32)."""
        tilt = -np.arctan(slope_y)
        return cls(float(tilt), float(-np.arctan(slope_x * np.cos(tilt))), fx, fy)

    @property
    def rotation(self) -> Matrix:
        """ᴴR_C (4.22)."""
        cp, sp, ct, st = np.cos(self.pan), np.sin(self.pan), np.cos(self.tilt), np.sin(self.tilt)
        return np.array([[cp, -sp * st, -sp * ct], [0.0, ct, -st], [sp, cp * st, cp * ct]])

    def project(self, x: Vector, y: Vector) -> tuple[Vector, Vector]:
        """x_H = f_x r₁/r₃, y_H = f_y r₂/r₃ with r = ᴴR_C (x/f_x, y/f_y, 1): (4.28) with the focal lengths it lacks."""
        r = self._rotated(x, y)
        return self.fx * r[0] / r[2], self.fy * r[1] / r[2]

    def jacobian(self, x: Vector, y: Vector) -> Matrix:
        """∂(x_H, y_H)/∂(x, y), … × 2 × 2: (4.29), (4.30)."""
        r, m = self._rotated(x, y), self.rotation
        focal = (self.fx, self.fy)
        rows = [
            [focal[i] / focal[j] * (m[i, j] * r[2] - r[i] * m[2, j]) / r[2] ** 2 for j in range(2)]
            for i in range(2)
        ]
        return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)

    def project_flow(self, x: Vector, y: Vector, u: Vector, v: Vector) -> tuple[Vector, Vector]:
        """The flow on the horizontal plane: constant on a floor over which the camera does not turn (4.35)."""
        moved = self.jacobian(x, y) @ np.stack((u, v), axis=-1)[..., None]
        return moved[..., 0, 0], moved[..., 1, 0]

    def ratio(
        self, x: Vector, y: Vector, normal: tuple[Vector, Vector], flow: Vector, direction: Vector
    ) -> Vector:
        """λ = u_n/(nᵀ J⁻¹ d): normal flow over that of the floor, d its flow on the horizontal plane.

        1 on the floor, 1/(1 − h/H) on what stands h over it, 1/(1 + d/H) in a hole. The text projects the normal flow
        on the motion instead, which varies by the directions of the normals: .46 ± .37 on the floor. NaN where n is
        across the motion.
        """
        back = np.linalg.inv(self.jacobian(x, y)) @ direction
        along = normal[0] * back[..., 0] + normal[1] * back[..., 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(
                np.abs(along) < ACROSS * np.hypot(back[..., 0], back[..., 1]), np.nan, flow / along
            )

    def _rotated(self, x: Vector, y: Vector) -> Vector:
        ray = np.stack((x / self.fx, y / self.fy, np.ones_like(x)))
        return np.tensordot(self.rotation, ray, axes=1)


def height_of_ratio(ratio: Vector) -> Vector:
    """h/H = 1 − 1/λ."""
    return 1 - 1 / np.asarray(ratio, float)
