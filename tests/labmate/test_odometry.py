"""Dead reckoning against closed forms of arcs, and its covariance against finite differences and sampling."""

from math import degrees, pi, radians

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from labmate.odometry import Odometry, OdometryNoise, Pose, WheelGeometry, wrapped

NOMINAL = WheelGeometry(0.340, 1.0, 50_000)
EXACT = OdometryNoise(0.0, 0.0, 0.0)


def reckon(
    steps: list[tuple[int, int]], geometry: WheelGeometry = NOMINAL, noise: OdometryNoise = EXACT
) -> Odometry:
    odometry = Odometry(geometry, noise)
    odometry.step(0, 0)
    left = right = 0
    for dl, dr in steps:
        left, right = left + dl, right + dr
        odometry.step(left, right)
    return odometry


def test_equal_counts_drive_straight_ahead() -> None:
    pose = reckon([(50_000, 50_000)]).pose
    assert (pose.x, pose.y, pose.heading) == (1.0, 0.0, 0.0)


def test_opposite_counts_turn_on_the_spot_to_the_left_when_the_right_wheel_leads() -> None:
    quarter = round(50_000 * 0.340 * pi / 4)
    pose = reckon([(-quarter, quarter)]).pose
    assert (pose.x, pose.y) == (0.0, 0.0)
    # Half a count of rounding on each wheel: 20 µm / 340 mm.
    assert pose.heading == pytest.approx(pi / 2, abs=2e-5 / 0.34)


@given(st.integers(-40_000, 40_000), st.integers(-40_000, 40_000), st.integers(2, 9))
def test_an_arc_is_exact_however_it_is_cut(left: int, right: int, pieces: int) -> None:
    whole = reckon([(left * pieces, right * pieces)]).pose
    cut = reckon([(left, right)] * pieces).pose
    # Only the rounding of some ten additions of numbers up to a few metres.
    assert (cut.x, cut.y, cut.heading) == pytest.approx((whole.x, whole.y, whole.heading), abs=1e-11)


def test_a_circle_closes() -> None:
    # Radius 1 m to the axle's middle: the wheels go at 1 ∓ 0.17 m.
    left, right = 2 * pi * 0.83 * 50_000, 2 * pi * 1.17 * 50_000
    whole = reckon([(round(left), round(right))]).pose
    assert degrees(whole.heading) == pytest.approx(360.0, abs=0.01)
    assert (whole.x, whole.y) == pytest.approx((0.0, 0.0), abs=1e-3)
    half = reckon([(round(left / 2), round(right / 2))]).pose
    assert (half.x, half.y) == pytest.approx((0.0, 2.0), abs=1e-4)


def test_the_wheel_ratio_bends_the_way_as_the_published_errors_do() -> None:
    true = WheelGeometry(0.3372, 1.00121, 50_000)
    pose = reckon([(200_000, 200_000)], true).pose
    # β = L κ, κ = 2 (E_d − 1)/((E_d + 1) b): 0.822° on a side of 4 m.
    assert degrees(pose.heading) == pytest.approx(degrees(4.0 * 2 * 0.00121 / (2.00121 * 0.3372)), rel=1e-9)
    assert pose.y == pytest.approx(4.0 * 4.0 * true.drift / 2, rel=1e-3)


def test_the_mean_of_the_two_wheels_stays_nominal() -> None:
    true = WheelGeometry(0.3372, 1.00121, 50_000)
    assert true.left_metres_per_count + true.right_metres_per_count == pytest.approx(2 / 50_000, rel=1e-15)
    assert true.right_metres_per_count / true.left_metres_per_count == pytest.approx(1.00121, rel=1e-15)


def test_the_counters_may_wrap_at_32_bits() -> None:
    odometry = Odometry(NOMINAL, EXACT)
    odometry.step(2**31 - 25_000, -(2**31) + 10)
    odometry.step(-(2**31) + 25_000, 2**31 - 10 - 50_000 + 20)
    assert odometry.pose.x == pytest.approx(0.0, abs=1e-12)
    assert odometry.pose.heading == pytest.approx(-2.0 / 0.34, rel=1e-9)


def test_the_heading_is_continuous_over_several_turns() -> None:
    quarter = round(50_000 * 0.340 * pi / 4)
    pose = reckon([(-quarter, quarter)] * 12).pose
    assert pose.heading == pytest.approx(6 * pi, abs=1e-3)
    assert wrapped(pose.heading) == pytest.approx(0.0, abs=1e-3)
    assert wrapped(-pi) == pi


def test_the_first_reading_moves_nothing() -> None:
    odometry = Odometry(NOMINAL, EXACT, Pose(1.0, 2.0, 3.0))
    assert odometry.step(12345, -99) == Pose(1.0, 2.0, 3.0)


def wandering(seed: int, steps: int) -> list[tuple[int, int]]:
    rng = np.random.default_rng(seed)
    return [(int(a), int(b)) for a, b in rng.integers(-2_000, 9_000, (steps, 2))]


def test_the_sensitivities_are_the_derivatives_by_wheel_base_and_ratio() -> None:
    way = wandering(1, 60)
    by_base, by_ratio = reckon(way, WheelGeometry(0.34, 1.001, 50_000)).sensitivity

    def end(base: float, ratio: float) -> np.ndarray:
        pose = reckon(way, WheelGeometry(base, ratio, 50_000)).pose
        return np.array([pose.x, pose.y, pose.heading])

    h = 1e-6
    # Central differences of a smooth function: h² of error against values of order 1 to 10.
    assert np.allclose(by_base, (end(0.34 + h, 1.001) - end(0.34 - h, 1.001)) / (2 * h), atol=1e-6)
    assert np.allclose(by_ratio, (end(0.34, 1.001 + h) - end(0.34, 1.001 - h)) / (2 * h), atol=1e-6)


def test_the_covariance_is_that_of_the_sampled_reckonings() -> None:
    way = wandering(2, 40)
    noise = OdometryNoise(0.002, 0.001, 0.0005)
    told = np.array(reckon(way, NOMINAL, noise).covariance)
    rng, samples = np.random.default_rng(3), 20_000
    base = 0.34 + 0.001 * rng.standard_normal(samples)
    ratio = 1 + 0.0005 * rng.standard_normal(samples)
    x, y, theta = np.zeros((3, samples))
    for left, right in way:
        s_l, s_r = left * 2 / (1 + ratio) / 50_000, right * 2 * ratio / (1 + ratio) / 50_000
        s_l = s_l + 0.002 * np.sqrt(np.abs(s_l)) * rng.standard_normal(samples)
        s_r = s_r + 0.002 * np.sqrt(np.abs(s_r)) * rng.standard_normal(samples)
        turn = (s_r - s_l) / base
        x += (s_l + s_r) / 2 * np.cos(theta + turn / 2)
        y += (s_l + s_r) / 2 * np.sin(theta + turn / 2)
        theta += turn
    scale = np.sqrt(np.outer(np.diag(told), np.diag(told)))
    # A covariance of N samples in units of its deviations is known to at most √(2/N) = 1 %; four of them.
    assert np.all(np.abs(np.cov([x, y, theta]) - told) / scale < 0.04)


def test_the_uncertainty_grows_with_the_way_and_never_shrinks_on_a_straight() -> None:
    odometry = Odometry(NOMINAL, OdometryNoise(0.001, 0.0, 0.0))
    odometry.step(0, 0)
    variances = []
    for n in range(1, 6):
        odometry.step(n * 50_000, n * 50_000)
        variances.append([odometry.covariance[i][i] for i in range(3)])
    assert all(np.all(np.diff(np.array(variances), axis=0) > 0, axis=0))
    # Along the way: mean of two wheels with k² s each, k² s/2. Heading: 2 k² s/b².
    assert variances[-1][0] == pytest.approx(1e-6 * 5 / 2, rel=1e-9)
    assert variances[-1][2] == pytest.approx(2e-6 * 5 / 0.34**2, rel=1e-9)


def test_standing_adds_no_uncertainty() -> None:
    odometry = reckon([(50_000, 50_000)], NOMINAL, OdometryNoise(0.001, 0.001, 0.001))
    before = odometry.covariance
    odometry.step(50_000, 50_000)
    assert odometry.covariance == before


def test_a_pose_seen_from_its_start_keeps_its_continuous_heading() -> None:
    seen = Pose(1.0, 3.0, radians(450.0)).seen_from(Pose(1.0, 2.0, radians(90.0)))
    assert (seen.x, seen.y) == pytest.approx((1.0, 0.0))
    assert degrees(seen.heading) == pytest.approx(360.0)


@pytest.mark.parametrize("value", [0.0, -0.34, float("nan"), float("inf")])
def test_a_geometry_that_cannot_be_is_refused(value: float) -> None:
    with pytest.raises(ValueError, match="wheel_base must be positive"):
        WheelGeometry(value, 1.0, 50_000)
