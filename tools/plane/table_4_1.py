"""Table 4.1 by Monte-Carlo: slant and tilt of a floor from noisy synthetic flow, 200 points of 256 × 256 pixels.

25 cm/s, camera 45° down, f = 192 and 256 px; |v₀| = 12.8 px a frame, for the thesis gives neither height nor rate.
In the thesis's frames: γ_x = 0, γ_y = 1, so slant φ = 0 and tilt ψ = −45°.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.plane.affine_flow import AffineSettings, fit_affine
from perception.plane.contact import estimate_contact
from perception.plane.inverse_perspective import InversePerspective
from perception.plane.plane_motion import PlaneMotion, from_delta
from perception.plane.window import Window

Vector = NDArray[np.float64]
FX, FY, SIDE = 192.0, 256.0, 256
V0_PX = -12.8
POINTS = 200
SETTINGS = AffineSettings(points=2 * POINTS)


@dataclass(frozen=True)
class Trial:
    """Slant φ and tilt ψ, deg, of one draw of the noise."""

    slant: float
    tilt: float


def flow_at(x: Vector, y: Vector, quadratic: bool) -> tuple[Vector, Vector]:
    """(4.6)–(4.8) for T = (0, T, T)/√2 over Z = Z₀ + Y: T_y/Z₀ = T_z/Z₀ = −v₀/f_y."""
    over = -V0_PX / FY
    u, v = over * x, V0_PX + 2 * over * y
    if quadratic:
        u, v = u - over / FY * x * y, v - over / FY * y * y
    return u, v


def draw_points(rng: np.random.Generator) -> tuple[Vector, Vector]:
    """Uniform over the image, from the principal point."""
    return rng.uniform(-SIDE / 2, SIDE / 2, POINTS), rng.uniform(-SIDE / 2, SIDE / 2, POINTS)


def try_affine(
    rng: np.random.Generator, sigma: float, quadratic: bool, normal: bool, outliers: float = 0.0
) -> Trial:
    """The thesis's estimate: θ (4.16), slopes (4.17), angles (4.32)."""
    x, y = draw_points(rng)
    u, v = (part + rng.normal(0, sigma, POINTS) for part in flow_at(x, y, quadratic))
    wrong = rng.uniform(size=POINTS) < outliers
    u, v = u + wrong * rng.uniform(-20, 20, POINTS), v + wrong * rng.uniform(-20, 20, POINTS)
    if normal:
        angle = rng.uniform(0, np.pi, POINTS)
        across, down = np.cos(angle), np.sin(angle)
        flow = fit_affine(x, y, across, down, across * u + down * v, rng, SETTINGS)
    else:
        one, none = np.ones(POINTS), np.zeros(POINTS)
        across, down, rate = np.r_[one, none], np.r_[none, one], np.r_[u, v]
        flow = fit_affine(np.tile(x, 2), np.tile(y, 2), across, down, rate, rng, SETTINGS)
    return _angles(*flow.slopes_over_focal)


def try_homography(rng: np.random.Generator, sigma: float) -> Trial:
    """Eight parameters fitted to the quadratic flow, t qᵀ from them."""
    x, y = draw_points(rng)
    u, v = (part + rng.normal(0, sigma, POINTS) for part in flow_at(x, y, quadratic=True))
    # About the principal point, so that pixels are what the thesis calls x and y.
    window = Window(-SIDE // 2, -SIDE // 2, SIDE // 8, SIDE // 8, 8)
    p, q, _ = window.from_pixels @ np.array((x, y, np.ones(POINTS)))
    one, none = np.ones(POINTS), np.zeros(POINTS)
    across = np.stack((one, p, q, none, none, none, -p * p, -p * q), axis=1)
    down = np.stack((none, none, none, one, p, q, -p * q, -q * q), axis=1)
    model = window.half * np.concatenate((across, down))
    delta = np.asarray(np.linalg.lstsq(model, np.concatenate((u, v)), rcond=None)[0])
    # The flow is a velocity: a step of a thousandth, so that the homography is its own first order.
    homography = window.to_pixels @ from_delta(np.asarray(1e-3 * delta)) @ window.from_pixels
    every = np.ones((window.rows, window.columns))
    motion = PlaneMotion(homography, window, np.eye(8), model.T @ model, np.zeros(4), 1.0, 1.0, 1.0, every)
    slopes = estimate_contact(motion, Intrinsics(256, 256, FX, FY, 0.0, 0.0)).slopes
    return _angles(slopes[0] / FX, slopes[1] / FY)


def _angles(across: float, down: float) -> Trial:
    view = InversePerspective.from_slopes(across * FX, down * FY)
    return Trial(float(np.degrees(view.pan)), float(np.degrees(view.tilt)))


def summarise(trials: list[Trial]) -> dict[str, float]:
    """Mean and standard deviation of both angles."""
    slant, tilt = (np.array([getattr(trial, name) for trial in trials]) for name in ("slant", "tilt"))
    return {
        "slant_mean": round(float(slant.mean()), 2),
        "slant_std": round(float(slant.std()), 2),
        "tilt_mean": round(float(tilt.mean()), 2),
        "tilt_std": round(float(tilt.std()), 2),
    }


def run(trials: int) -> dict[str, dict[str, float]]:
    """All rows."""
    rng = np.random.default_rng(41)
    table: dict[str, dict[str, float]] = {}
    for sigma in (0.0, 1.0, 1.5, 2.0):
        number = 1 if sigma == 0 else trials
        for name, quadratic, normal in (
            ("full flow, affine truth", False, False),
            ("normal flow, affine truth", False, True),
            ("full flow, quadratic truth", True, False),
        ):
            draws = [
                try_affine(rng, sigma, quadratic, normal) for _ in range(max(number, 20 if quadratic else 1))
            ]
            table[f"{name}, σ = {sigma:g}"] = summarise(draws)
        table[f"eight parameters, quadratic truth, σ = {sigma:g}"] = summarise(
            [try_homography(rng, sigma) for _ in range(number)]
        )
    table["full flow, affine truth, σ = 1, 20 % outliers"] = summarise(
        [try_affine(rng, 1.0, False, False, 0.2) for _ in range(trials)]
    )
    return table
