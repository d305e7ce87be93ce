"""Where a point of given inverse depth goes when the camera moves: thesis (2.20)–(2.22), for finite motions.

With the ray p = (x, y, 1) of a pixel, inverse depth ρ = 1/Z and motion P' = R P + t, the point goes
to q = R p + ρ t, so x' = q₁/q₃ and ρ' = ρ/q₃. That is (2.21) with a = r₃·p and b = t₃, and its
derivative by ρ is the vector C of (2.22), at the depth at hand instead of at infinity.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from perception.depth.intrinsics import Intrinsics
from perception.depth.motion import Motion

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
ALL = slice(None)


@dataclass(frozen=True)
class Projection:
    """Where every pixel goes at a given inverse depth; all arrays are height × width."""

    x: Field
    y: Field
    scale: Field  # q₃ = a + bρ, the ratio Z'/Z
    slope_x: Field  # ∂x'/∂ρ in pixels per 1/m: the vector C of (2.22)
    slope_y: Field
    shift_z: float  # b of (2.21)


class Epipolar:
    """The geometry of one pair of pictures: base view, motion to the other view, camera."""

    def __init__(self, camera: Intrinsics, motion: Motion, shape: tuple[int, int]) -> None:
        self.camera = camera
        self.motion = motion
        self.shape = shape

    @cached_property
    def _rays(self) -> tuple[Field, Field, Field]:
        """R p in pixels of the other view, so that it is ready to be divided: (fx r₁·p + cx r₃·p, …)."""
        height, width = self.shape
        mixed = self.camera.matrix @ self.motion.rotation @ np.linalg.inv(self.camera.matrix)
        x = np.arange(width, dtype=np.float64)
        y = np.arange(height, dtype=np.float64)
        first, second, third = (np.empty(self.shape, np.float32) for _ in range(3))
        for row, ray in zip(mixed, (first, second, third), strict=True):
            np.add.outer(row[1] * y + row[2], row[0] * x, out=ray, casting="same_kind")
        return first, second, third

    @cached_property
    def _shift(self) -> tuple[np.float32, np.float32, np.float32]:
        shift = (self.camera.matrix @ self.motion.translation).astype(np.float32)
        return shift[0], shift[1], shift[2]

    def project(self, inverse_depth: Field | float, rows: slice = ALL) -> Projection:
        """Where the pixels of the rows (all, if none are named) go when they stand at `inverse_depth` (1/m)."""
        first, second, third = (ray[rows] for ray in self._rays)
        shift_x, shift_y, shift_z = self._shift
        rho = np.asarray(inverse_depth, np.float32)
        scale = third + rho * shift_z
        with np.errstate(divide="ignore", invalid="ignore"):
            behind = np.float32(1) / scale
        np.copyto(behind, np.float32(np.nan), where=~(scale > 1e-3))
        x = (first + rho * shift_x) * behind
        y = (second + rho * shift_y) * behind
        return Projection(
            x, y, scale, (shift_x - x * shift_z) * behind, (shift_y - y * shift_z) * behind, float(shift_z)
        )

    def in_view(self, projection: Projection) -> NDArray[np.bool_]:
        """Which pixels fall on the other picture."""
        height, width = self.shape
        x, y = projection.x, projection.y
        return np.asarray((x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5))

    def homography(self, inverse_depth: float) -> Matrix:
        """Base pixels to pixels of the other view for the plane Z = 1/ρ: K (R + ρ t e₃ᵀ) K⁻¹."""
        matrix = self.camera.matrix
        plane = self.motion.rotation.copy()
        plane[:, 2] += inverse_depth * self.motion.translation
        return np.asarray(matrix @ plane @ np.linalg.inv(matrix))

    def parallax(self, near: float, far: float) -> float:
        """The greatest displacement in pixels between a point at 1/near and one at 1/far (inverse depths)."""
        height, width = self.shape
        x = np.array([0.0, width - 1.0, 0.0, width - 1.0, (width - 1) / 2])
        y = np.array([0.0, 0.0, height - 1.0, height - 1.0, (height - 1) / 2])
        points = np.stack([x, y, np.ones(5)])
        moved = []
        for inverse_depth in (near, far):
            image = self.homography(inverse_depth) @ points
            if (image[2] <= 1e-3).any():
                return float("inf")
            moved.append(image[:2] / image[2])
        return float(np.hypot(*(moved[0] - moved[1])).max())

    def planes(self, lowest: float, highest: float, step_px: float = 1.0) -> NDArray[np.float64]:
        """Inverse depths from `lowest` to `highest`, so close that no pixel moves by more than `step_px` between."""
        count = 3
        span = self.parallax(highest, lowest)
        if np.isfinite(span):
            count = max(count, int(np.ceil(span / step_px)) + 1)
        return np.linspace(lowest, highest, count)
