"""The thesis's affine flow: (4.8)–(4.17) on flow made of them, and table 4.1."""

import numpy as np
import pytest

from perception.camera.intrinsics import Intrinsics
from perception.plane.affine_flow import AffineFlow, fit_affine
from perception.plane.errors import PlaneError
from perception.plane.plane_motion import PlaneMotion
from perception.plane.window import Window
from tools.plane.table_4_1 import summarise, try_affine, try_homography

F = 150.0


def theta(tx: float, ty: float, tz: float, across: float, down: float) -> np.ndarray:
    """(4.8) with f_x = f_y = F, no rotation, speeds over Z₀; v₀, v_x, v_y, u₀, u_x, u_y."""
    return np.array([-F * ty, ty * across, tz + down * ty, -F * tx, tz + across * tx, tx * down])


@pytest.mark.parametrize("speed", [(0.02, 0.03, 0.01), (0.0, 0.03, 0.01), (0.02, 0.0, -0.01)])
def test_slopes_follow_from_three_relations_also_where_one_speed_is_zero(
    speed: tuple[float, float, float],
) -> None:
    flow = AffineFlow(theta(*speed, 0.4, -0.7), np.eye(6), 1.0)
    across, down = flow.slopes_over_focal
    assert (F * across, F * down) == pytest.approx((0.4, -0.7))
    assert flow.approach == pytest.approx(speed[2])


def test_a_fit_to_normal_flow_finds_its_six_parameters_and_drops_what_moves_otherwise() -> None:
    rng = np.random.default_rng(2)
    true = theta(0.01, 0.02, 0.015, 0.2, 0.5)
    x, y = rng.uniform(-60, 60, (2, 600))
    angle = rng.uniform(0, np.pi, 600)
    across, down = np.cos(angle), np.sin(angle)
    v0, vx, vy, u0, ux, uy = true
    rate = across * (u0 + ux * x + uy * y) + down * (v0 + vx * x + vy * y) + rng.normal(0, 0.02, 600)
    rate[:120] += 5
    found = fit_affine(x, y, across, down, rate, rng)
    # Five standard deviations of .02/√480, over 35 px for the slopes.
    assert found.theta[[0, 3]] == pytest.approx(true[[0, 3]], abs=0.01)
    assert found.theta[[1, 2, 4, 5]] == pytest.approx(true[[1, 2, 4, 5]], abs=3e-4)
    assert 0.75 < found.inliers < 0.81
    off = (found.theta - true) / np.sqrt(np.diag(found.covariance))
    assert np.abs(off).max() < 4


def test_five_points_are_too_few() -> None:
    one = np.ones(5)
    with pytest.raises(PlaneError, match="at least 6"):
        fit_affine(one, one, one, one, one, np.random.default_rng(0))


def test_the_first_order_of_a_homography_is_its_affine_flow() -> None:
    camera = Intrinsics(128, 128, F, F, 63.5, 63.5)
    window = Window.central((128, 128), 80, 80)
    homography = np.array([[1.02, 0.01, 1.0], [-0.02, 1.03, -2.0], [1e-4, -2e-4, 1.0]])
    every = np.ones((10, 10))
    motion = PlaneMotion(homography, window, np.eye(8), np.eye(8), np.zeros(4), 1.0, 1.0, 1.0, every)
    found = AffineFlow.of(motion, camera).theta

    def flow(x: float, y: float) -> np.ndarray:
        point = homography @ np.array([x + 63.5, y + 63.5, 1.0])
        return point[:2] / point[2] - np.array([x + 63.5, y + 63.5])

    step = 1e-4
    across, down = ((flow(*(step * unit)) - flow(0, 0)) / step for unit in np.eye(2))
    (u0, v0), (ux, vx), (uy, vy) = flow(0, 0), across, down
    assert found == pytest.approx([v0, vx, vy, u0, ux, uy], abs=1e-5)


@pytest.mark.parametrize(
    ("sigma", "normal", "slant", "tilt"),
    [(1.0, False, 0.60, 0.83), (2.0, False, 1.21, 1.67), (1.0, True, 0.91, 1.22)],
)
def test_table_4_1_with_affine_truth(sigma: float, normal: bool, slant: float, tilt: float) -> None:
    # Standard deviations of 1000 trials of the page of equations; here 120, so 7 % more or less, and 1.3 × allowed.
    rng = np.random.default_rng(41)
    found = summarise([try_affine(rng, sigma, quadratic=False, normal=normal) for _ in range(120)])
    assert found["slant_mean"] == pytest.approx(0.0, abs=0.3)
    assert found["tilt_mean"] == pytest.approx(-45.0, abs=0.4)
    assert found["slant_std"] < 1.3 * slant
    assert found["tilt_std"] < 1.3 * tilt


def test_quadratic_truth_tilts_the_affine_estimate_by_two_degrees_and_not_eight_parameters() -> None:
    rng = np.random.default_rng(42)
    affine = summarise([try_affine(rng, 0.0, quadratic=True, normal=False) for _ in range(100)])
    eight = summarise([try_homography(rng, 0.0) for _ in range(3)])
    # The page: −42.7 ± 1.1; a mean of 100 is known to .11.
    assert affine["tilt_mean"] == pytest.approx(-42.7, abs=0.35)
    assert eight["tilt_mean"] == pytest.approx(-45.0, abs=0.01)
    noisy = summarise([try_homography(rng, 1.0) for _ in range(100)])
    assert noisy["tilt_mean"] == pytest.approx(-45.0, abs=0.3)
