"""Where a point of given inverse depth goes when the camera moves: thesis (2.20)–(2.22), for finite motions.

With the ray p = (x, y, 1) of a pixel, inverse depth ρ = 1/Z and motion P' = R P + t, the point goes
to q = R p + ρ t, so x' = q₁/q₃ and ρ' = ρ/q₃. That is (2.21) with a = r₃·p and b = t₃, and its
derivative by ρ is the vector C of (2.22), at the depth at hand instead of at infinity.
"""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth.geometry.pinhole import Pinhole
from perception.image.bands import join_bands
from perception.image.select import select

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
Some = slice | tuple[slice, slice] | NDArray[np.bool_]
"""Some rows, some rows and columns, or a mask."""


@dataclass(frozen=True)
class Projection:
    """Where every pixel goes at a given inverse depth; all arrays are height × width."""

    x: Field
    y: Field
    scale: Field  # q₃ = a + bρ, the ratio Z'/Z
    slope_x: Field  # ∂x'/∂ρ in pixels per 1/m: the vector C of (2.22)
    slope_y: Field
    shift_z: float  # b of (2.21)

    @cached_property
    def line(self) -> tuple[Field, Field, Field]:
        """Unit vector along the epipolar line (ex, ey), and |C|, pixels per 1/m."""
        length = np.sqrt(np.square(self.slope_x) + np.square(self.slope_y))
        safe = np.maximum(length, np.float32(1e-9))
        away = length > 1e-9
        return select(away, self.slope_x / safe, 1), select(away, self.slope_y / safe, 0), length


class Epipolar:
    """The geometry of one pair of images: base view, motion to the other view, camera."""

    def __init__(self, camera: Pinhole, motion: Motion, shape: tuple[int, int]) -> None:
        self.camera = camera
        self.motion = motion
        self.shape = shape

    @cached_property
    def _rays(self) -> Field:
        """R p in pixels of the other view, so that it is ready to be divided: (fx r₁·p + cx r₃·p, …);
        3 × height × width."""
        height, width = self.shape
        mixed = self.homography(0.0)
        x = np.arange(width, dtype=np.float64)
        y = np.arange(height, dtype=np.float64)
        rays = np.empty((3, height, width), np.float32)
        for row, ray in zip(mixed, rays, strict=True):
            np.add.outer(row[1] * y + row[2], row[0] * x, out=ray, casting="same_kind")
        return rays

    @cached_property
    def _calibration(self) -> tuple[Matrix, Matrix]:
        """K and K⁻¹."""
        matrix = self.camera.matrix
        return matrix, np.asarray(np.linalg.inv(matrix))

    @cached_property
    def _shift(self) -> tuple[np.float32, np.float32, np.float32]:
        shift = (self.camera.matrix @ self.motion.translation).astype(np.float32)
        return shift[0], shift[1], shift[2]

    def project(self, inverse_depth: Field | float, some: Some | None = None) -> Projection:
        """Where pixels of the inverse depth (1/m, height × width or one number) go: all, or only some."""
        rho = np.asarray(inverse_depth, np.float32)
        shift_x, shift_y, shift_z = self._shift

        def work(rho: Field, some: Some) -> tuple[Field, ...]:
            x, y, scale, behind = self._place(rho, some)
            return x, y, scale, (shift_x - x * shift_z) * behind, (shift_y - y * shift_z) * behind

        if some is None:
            parts = join_bands(
                self.shape, lambda band: work(rho[band.inner] if rho.ndim else rho, band.inner)
            )
        else:
            parts = work(rho, some)
        x, y, scale, slope_x, slope_y = parts
        return Projection(x, y, scale, slope_x, slope_y, float(shift_z))

    def meet(self, inverse_depth: Field | float, some: Some) -> tuple[Field, Field]:
        """Only x' and y' of `project`."""
        x, y, _, _ = self._place(inverse_depth, some)
        return x, y

    def in_view(self, inverse_depth: Field | float, some: Some) -> NDArray[np.bool_]:
        """Which pixels of some rows or of a mask fall on the other image from `inverse_depth` (1/m)."""
        height, width = self.shape
        x, y = self.meet(inverse_depth, some)
        return np.asarray((x > -0.5) & (x < width - 0.5) & (y > -0.5) & (y < height - 0.5))

    def _place(self, inverse_depth: Field | float, some: Some) -> tuple[Field, Field, Field, Field]:
        """x', y', q₃ and 1/q₃; NaN behind the camera."""
        if isinstance(some, np.ndarray):
            # An index by a mask would search it for every ray, and branch.
            first, second, third = self._rays.reshape(3, -1).take(np.flatnonzero(some), axis=1)
        else:
            first, second, third = self._rays[:, *(some if isinstance(some, tuple) else (some,))]
        shift_x, shift_y, shift_z = self._shift
        rho = np.asarray(inverse_depth, np.float32)
        scale = third + rho * shift_z
        with np.errstate(divide="ignore", invalid="ignore"):
            behind = np.float32(1) / scale
        hidden = scale <= 1e-3
        if hidden.any():
            behind[hidden] = np.nan
        return (first + rho * shift_x) * behind, (second + rho * shift_y) * behind, scale, behind

    def overlaps(self, least: float) -> bool:
        """Whether that part of the image, or more, is seen in the other one from far away."""
        return bool(self.in_view(0.0, slice(None, None, 8)).mean() >= least)

    def homographies(self, inverse_depths: NDArray[np.float64]) -> Matrix:
        """Base pixels to pixels of the other view for planes Z = 1/ρ, K (R + ρ t e₃ᵀ) K⁻¹; n × 3 × 3."""
        matrix, inverse = self._calibration
        planes = np.repeat(self.motion.rotation[None], len(inverse_depths), axis=0)
        planes[:, :, 2] += inverse_depths[:, None] * self.motion.translation
        return np.asarray(matrix @ planes @ inverse)

    def homography(self, inverse_depth: float) -> Matrix:
        """That of one plane, 3 × 3."""
        return np.asarray(self.homographies(np.array([inverse_depth]))[0])

    def magnification(self, inverse_depth: float) -> float:
        """How many pixels of the other view one of this makes in its middle, 1/q₃; at least ⅝ and at most 1.6."""
        height, width = self.shape
        scale = float(self.homography(inverse_depth)[2] @ (width / 2, height / 2, 1))
        return 1 / min(max(scale, 0.625), 1.6)

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
