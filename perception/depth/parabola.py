"""Sub-pixel minimum of the error surface and its uncertainty, thesis (2.9)–(2.11)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]


def fit_parabola(below: Field, here: Field, above: Field, step: float = 1.0) -> tuple[Field, Field, Field]:
    """Minimum of q(u) = a u² + b u + c through q(−step), q(0), q(step): û = −b/2a (2.10).

    Returns:
        û, q'' = 2a and q(û); û is NaN where a ≤ 0 or |û| > step/2, for there the middle is no minimum.
    """
    curvature = (below - 2 * here + above) / np.float32(step**2)
    slope = (above - below) / np.float32(2 * step)
    with np.errstate(divide="ignore", invalid="ignore"):
        offset = np.where(curvature > 0, -slope / curvature, np.float32(np.nan))
        offset = np.where(np.abs(offset) <= step / 2, offset, np.float32(np.nan))
        least = here - np.float32(0.5) * curvature * offset * offset
    return offset, curvature, np.maximum(least, 0)


def disparity_variance(least: Field, curvature: Field, pixels: int) -> Field:
    """σ_u² = 2 q_min / ((N − 1) q''): (2.11) as it must be, in px² whatever the grey scale.

    As printed, q''⁻² q, the unit is px⁴ per grey level squared. N is the number of pixels of the window.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(curvature > 0, 2 * least / ((pixels - 1) * curvature), np.float32(np.inf))


@dataclass(frozen=True)
class Quadric:
    """The error surface near its minimum: place (u, v), Hessian and value; arrays height × width."""

    u: Field
    v: Field
    uu: Field
    uv: Field
    vv: Field
    least: Field

    def covariance(self, noise_power: Field) -> tuple[Field, Field, Field]:
        """The 2×2 covariance 2 s² H⁻¹ (uu, uv, vv): (2.11) along every direction at once.

        noise_power s² is q_min/(N − 1) or whatever is known better. Infinite where H is not positive.
        """
        determinant = self.uu * self.vv - self.uv * self.uv
        good = (determinant > 0) & (self.uu > 0)
        with np.errstate(divide="ignore", invalid="ignore"):
            gain = np.where(good, 2 * noise_power / determinant, np.float32(0))
        far = np.float32(np.inf)
        return np.where(good, self.vv * gain, far), -self.uv * gain, np.where(good, self.uu * gain, far)


def fit_quadric(q: dict[tuple[int, int], Field], step: float) -> Quadric:
    """The quadric through the seven values at (0, 0), (±1, 0), (0, ±1), (1, 1), (−1, −1) steps.

    Its minimum is the common one of both axes, not that of two separate parabolas: for an oblique edge
    they differ. NaN where the surface has no minimum there.
    """
    middle = q[0, 0]
    scale = np.float32(1 / step**2)
    uu = (q[1, 0] - 2 * middle + q[-1, 0]) * scale
    vv = (q[0, 1] - 2 * middle + q[0, -1]) * scale
    uv = (q[1, 1] + q[-1, -1] - q[1, 0] - q[-1, 0] - q[0, 1] - q[0, -1] + 2 * middle) * (scale / 2)
    along = (q[1, 0] - q[-1, 0]) * np.float32(0.5 / step)
    across = (q[0, 1] - q[0, -1]) * np.float32(0.5 / step)
    determinant = uu * vv - uv * uv
    with np.errstate(divide="ignore", invalid="ignore"):
        good = (determinant > 0) & (uu > 0)
        u = np.where(good, (uv * across - vv * along) / determinant, np.float32(np.nan))
        v = np.where(good, (uv * along - uu * across) / determinant, np.float32(np.nan))
    least = np.maximum(middle + np.float32(0.5) * (along * u + across * v), 0)
    return Quadric(u, v, uu, uv, vv, least)
