"""Sub-pixel minimum of the error surface and its uncertainty, thesis (2.9)–(2.11)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.image.select import select

Field = NDArray[np.float32]


def fit_parabola(below: Field, here: Field, above: Field, step: float = 1.0) -> tuple[Field, Field, Field]:
    """Minimum of q(u) = a u² + b u + c through q(−step), q(0), q(step): û = −b/2a (2.10).

    Args:
        below, here, above: q(−step), q(0), q(step), height × width, grey levels squared.
        step: px.

    Returns:
        û, q'' = 2a and q(û); û is NaN where a ≤ 0 or |û| > step/2, for there the middle is no minimum.
    """
    curvature = (below - 2 * here + above) / np.float32(step**2)
    slope = (above - below) / np.float32(2 * step)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        offset = np.where(curvature > 0, -slope / curvature, np.float32(np.nan))
        offset = np.where(np.abs(offset) <= step / 2, offset, np.float32(np.nan))
        least = here - np.float32(0.5) * curvature * offset * offset
    return offset, curvature, np.maximum(least, 0)


def disparity_variance(least: Field, curvature: Field, pixels: int) -> Field:
    """σ_u² = 2 q_min / ((N − 1) q''): (2.11) as it must be, in px² whatever the grey scale.

    As printed, q''⁻² q, the unit is px⁴ per grey level squared.

    Args:
        least: q_min, grey levels squared.
        curvature: q'', grey levels squared per px².
        pixels: N, the number of pixels of the window.
    """
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        return np.where(curvature > 0, 2 * least / ((pixels - 1) * curvature), np.float32(np.inf))


@dataclass(frozen=True)
class Quadric:
    """The error surface around the predicted place: value, slopes and curvatures; arrays height × width.

    Its methods take the weight λ_ep of the soft epipolar term λ_ep v² of (2.7), which is added to it.
    """

    value: Field
    slope_u: Field
    slope_v: Field
    uu: Field
    uv: Field
    vv: Field

    def minimum(self, epipolar_weight: Field | float = 0.0) -> tuple[Field, Field, Field]:
        """Place (u, v) of the minimum and the value there; NaN where the surface has none."""
        vv, determinant = self._with_line(epipolar_weight)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            good = (determinant > 0) & (self.uu > 0)
            u = select(good, (self.uv * self.slope_v - vv * self.slope_u) / determinant, np.nan)
            v = select(good, (self.uv * self.slope_u - self.uu * self.slope_v) / determinant, np.nan)
        least = np.maximum(self.value + np.float32(0.5) * (self.slope_u * u + self.slope_v * v), 0)
        return u, v, least

    def covariance(
        self, noise_power: Field | float, epipolar_weight: Field | float = 0.0
    ) -> tuple[Field, Field, Field]:
        """The 2×2 covariance 2 s² H⁻¹ (uu, uv, vv): (2.11) along every direction at once.

        noise_power s² is q_min/(N − 1) or whatever is known better. Infinite where the surface has no minimum.
        """
        vv, determinant = self._with_line(epipolar_weight)
        good = (determinant > 0) & (self.uu > 0)
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            gain = select(good, np.float32(2) * noise_power / determinant, 0)
            return select(good, vv * gain, np.inf), -self.uv * gain, select(good, self.uu * gain, np.inf)

    def thinned(self, step: int) -> "Quadric":
        """Every `step`-th pixel both ways."""
        return Quadric(*(part[::step, ::step] for part in self._parts))

    def rows(self, rows: slice) -> "Quadric":
        """Some of the rows."""
        return Quadric(*(part[rows] for part in self._parts))

    @property
    def _parts(self) -> tuple[Field, ...]:
        return self.value, self.slope_u, self.slope_v, self.uu, self.uv, self.vv

    def _with_line(self, epipolar_weight: Field | float) -> tuple[Field, Field]:
        vv = self.vv + np.asarray(2 * epipolar_weight, np.float32)
        return vv, self.uu * vv - self.uv * self.uv
