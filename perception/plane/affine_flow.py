"""The affine flow of a plane, thesis (4.9)–(4.19): fitted once to normal flow with points chosen anew at random."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.flow.normal import estimate_normal_flow
from perception.plane.errors import PlaneError
from perception.plane.plane_motion import PlaneMotion
from perception.plane.window import Window

Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]
UNKNOWNS = 6


@dataclass(frozen=True)
class AffineSettings:
    """What the thesis leaves open of its estimate."""

    points: int = 400
    """Chosen at random in each round."""
    rounds: int = 20
    near: float = 2.5
    """A point may be chosen whose error is at most this many times the median one, as a deviation (1.4826 MAD)."""
    least_slope: float = 4.0
    """Points of a weaker gradient say nothing, grey/px."""
    same: float = 1e-4
    """Changes of θ, px at the rim, that leave it unchanged."""


THESIS = AffineSettings()


@dataclass(frozen=True, eq=False)
class AffineFlow:
    """u = u₀ + u_x x + u_y y, v = v₀ + v_x x + v_y y, (4.9); x right, y down from the principal point, px a frame."""

    theta: Vector
    """v₀, v_x, v_y, u₀, u_x, u_y (4.13)."""
    covariance: Matrix
    inliers: float
    """Part of the points that the model explains."""

    @property
    def slopes_over_focal(self) -> tuple[float, float]:
        """γ_x/f_x and γ_y/f_y, for a camera that does not turn: the three relations of (4.17) by least squares.

        v_x = −g_x v₀, u_y = −g_y u₀, u_x − v_y = −g_x u₀ + g_y v₀; the print takes the second or the third alone.
        """
        v0, vx, vy, u0, ux, uy = self.theta
        matrix = np.array([[v0, 0.0], [0.0, u0], [-u0, v0]])
        slopes = np.linalg.lstsq(matrix, np.array([-vx, -uy, ux - vy]), rcond=None)[0]
        return float(slopes[0]), float(slopes[1])

    @property
    def approach(self) -> float:
        """T_z/Z₀ a frame, for a camera that does not turn: u_x + g_x u₀ and v_y + g_y v₀ (4.8), averaged."""
        v0, _, vy, u0, ux, _ = self.theta
        across, down = self.slopes_over_focal
        return float((ux + across * u0 + vy + down * v0) / 2)

    @classmethod
    def of(cls, motion: PlaneMotion, camera: Intrinsics) -> "AffineFlow":
        """The first order of a homography's flow at the principal point."""
        h = motion.homography / motion.homography[2, 2]
        x, y = camera.cx, camera.cy
        depth = h[2, 0] * x + h[2, 1] * y + 1
        place = (h[:2, 0] * x + h[:2, 1] * y + h[:2, 2]) / depth
        slopes = (h[:2, :2] - np.outer(place, h[2, :2])) / depth - np.eye(2)
        theta = np.array([place[1] - y, *slopes[1], place[0] - x, *slopes[0]])
        frame = motion.window.to_pixels
        # An error δ moves a pixel by half·B(x) δ in the first image; its quadratic terms have no first order in
        # the middle of the window, where θ is taken when that is the principal point.
        half = frame[0, 0]
        to_theta = np.zeros((UNKNOWNS, 8))
        to_theta[0, 3], to_theta[1, 4], to_theta[2, 5] = half, 1, 1
        to_theta[3, 0], to_theta[4, 1], to_theta[5, 2] = half, 1, 1
        return cls(theta, to_theta @ motion.covariance @ to_theta.T, motion.inliers)


def fit_affine(
    x: Vector,
    y: Vector,
    slope_x: Vector,
    slope_y: Vector,
    rate: Vector,
    rng: np.random.Generator,
    settings: AffineSettings = THESIS,
) -> AffineFlow:
    """θ of I_x u + I_y v = −I_t (4.10)–(4.16), by QR, points being chosen anew among those that agree with it.

    1. A random set of points gives θ₀. 2. A new random set is drawn from those whose error is small. 3. It gives θ_k.
    4. Until θ stays, or the rounds are over.

    Args:
        x, y: from the principal point, px.
        slope_x, slope_y: I_x, I_y; any direction (1, 0), (0, 1) makes the component of a full flow an observation.
        rate: −I_t, or u and v.

    Raises:
        PlaneError: fewer points than unknowns.
    """
    if len(x) < UNKNOWNS:
        raise PlaneError(f"{len(x)} points for an affine flow: at least {UNKNOWNS} are needed")
    scale = max(float(np.abs(x).max()), float(np.abs(y).max()), 1e-9)
    p, q = x / scale, y / scale
    model = np.stack((slope_y, p * slope_y, q * slope_y, slope_x, p * slope_x, q * slope_x), axis=1)
    number = min(settings.points, len(x))
    chosen = rng.choice(len(x), number, replace=False)
    theta = _solve(model[chosen], rate[chosen])
    for _ in range(settings.rounds):
        error = np.abs(rate - model @ theta)
        limit = settings.near * 1.4826 * float(np.median(error)) + 1e-12
        near = np.flatnonzero(error <= limit)
        chosen = rng.choice(near, min(number, len(near)), replace=False)
        before, theta = theta, _solve(model[chosen], rate[chosen])
        if np.abs(theta - before).max() < settings.same:
            break
    left = rate[chosen] - model[chosen] @ theta
    variance = float(left @ left) / max(len(chosen) - UNKNOWNS, 1)
    back = np.array([1, 1 / scale, 1 / scale] * 2)
    covariance = variance * np.linalg.pinv(model[chosen].T @ model[chosen], hermitian=True)
    return AffineFlow(theta * back, back[:, None] * covariance * back, len(near) / len(x))


def estimate_affine_flow(
    first: NDArray[np.uint8],
    second: NDArray[np.uint8],
    window: Window,
    camera: Intrinsics,
    rng: np.random.Generator,
    settings: AffineSettings = THESIS,
) -> AffineFlow:
    """The preset `thesis`: θ of a window between two images, in one pass, from normal flow alone."""
    normal = estimate_normal_flow((first, second))
    x, y = window.pixels()
    slope_x, slope_y = (part[window.part].astype(float) for part in (normal.slope_x, normal.slope_y))
    flow, strength = normal.flow[window.part].astype(float), normal.strength[window.part]
    good = np.isfinite(flow) & (strength >= settings.least_slope)
    rate = flow * np.hypot(slope_x, slope_y)
    return fit_affine(
        x[good] - camera.cx, y[good] - camera.cy, slope_x[good], slope_y[good], rate[good], rng, settings
    )


def _solve(model: Matrix, rate: Vector) -> Vector:
    return np.asarray(np.linalg.lstsq(model, rate, rcond=None)[0])
