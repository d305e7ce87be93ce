"""UMBmark against the published figures of this base, closed form beside an independent simulation."""

from cmath import exp
from math import degrees, pi, sin

import numpy as np
import pytest

from labmate.calibration import (
    Calibration,
    CalibrationError,
    Closing,
    Direction,
    Run,
    closing_of,
    estimate_closed_form,
    predict_closing,
    refine_on_tracks,
)
from labmate.odometry import Pose, WheelGeometry

NOMINAL = WheelGeometry(0.340, 1.0, 50_000)
TRUE = WheelGeometry(0.3372, 1.00121, 50_000)
SIDE = 4.0


def driven(direction: Direction, true: WheelGeometry = TRUE, corner: float = pi / 2) -> Run:
    """A square of the nominal base on the true wheels, in whole counts: complex numbers, no code of ours."""
    quarter = corner / 2 * NOMINAL.wheel_base * (1 if direction == "ccw" else -1)
    position, heading, left, right = 0j, 0.0, 0, 0
    track = [(0, 0)]
    right_scale = 2 * true.wheel_ratio / (1 + true.wheel_ratio)
    for _ in range(4):
        for way_left, way_right in ((SIDE, SIDE), (-quarter, quarter)):
            counts = round(way_left * 50_000), round(way_right * 50_000)
            left, right = left + counts[0], right + counts[1]
            track.append((left, right))
            s_l, s_r = counts[0] / 50_000 * (2 - right_scale), counts[1] / 50_000 * right_scale
            turn = (s_r - s_l) / true.wheel_base
            chord = (s_l + s_r) / 2 * (sin(turn / 2) / (turn / 2) if turn else 1.0)
            position += chord * exp(1j * (heading + turn / 2))
            heading += turn
    return Run(direction, track, Pose(position.real, position.imag, heading))


@pytest.mark.parametrize(("direction", "published"), [("ccw", 0.306), ("cw", 0.015)])
def test_the_uncalibrated_square_closes_as_published(direction: Direction, published: float) -> None:
    predicted = predict_closing(direction, SIDE, NOMINAL, TRUE)
    # The tolerance on the page's figures.
    assert predicted.distance == pytest.approx(published, abs=0.003)
    simulated = closing_of(driven(direction), NOMINAL)
    # Whole counts: 8 arcs of ±10 µm, turned into 12 m of way by 20 µm/0.34 m of heading.
    assert (predicted.x, predicted.y) == pytest.approx((simulated.x, simulated.y), abs=1e-3)


def test_the_two_errors_add_one_way_and_cancel_the_other() -> None:
    corner = degrees(pi / 2 * (0.340 / 0.3372 - 1))
    side = degrees(SIDE * TRUE.drift)
    # α and β of the page's geometry: each is under a degree, their sum four times over opens the square.
    assert (corner, side) == pytest.approx((0.747, 0.822), abs=1e-3)
    ccw, cw = (driven(d).true_end.heading for d in ("ccw", "cw"))
    assert degrees(ccw) - 360 == pytest.approx(4 * (corner + side), abs=0.01)
    assert degrees(cw) + 360 == pytest.approx(4 * (side - corner), abs=0.01)


def test_the_closed_form_finds_the_geometry_within_the_criterion() -> None:
    closings = [closing_of(driven(d), NOMINAL) for d in ("ccw", "cw")]
    found = estimate_closed_form(closings, SIDE, NOMINAL)
    # The criteria; what is left is second order in α + β.
    assert found.wheel_base == pytest.approx(0.3372, abs=0.3e-3)
    assert found.wheel_ratio == pytest.approx(1.00121, abs=1e-4)


def test_the_fit_to_the_tracks_is_exact() -> None:
    runs = [driven(d) for d in ("ccw", "cw")]
    start = estimate_closed_form([closing_of(run, NOMINAL) for run in runs], SIDE, NOMINAL)
    found = refine_on_tracks(runs, start, 50_000)
    # True end poses and whole counts without rounding of the true way: only the iteration's own threshold.
    assert found.wheel_base == pytest.approx(0.3372, abs=1e-8)
    assert found.wheel_ratio == pytest.approx(1.00121, abs=1e-9)
    for run in runs:
        assert closing_of(run, found.geometry(50_000)).distance < 1e-6


@pytest.mark.parametrize("base", [0.330, 0.3372, 0.34, 0.352])
@pytest.mark.parametrize("ratio", [0.997, 1.0, 1.00121, 1.004])
def test_any_base_of_this_kind_is_calibrated_to_under_25_mm(base: float, ratio: float) -> None:
    true = WheelGeometry(base, ratio, 50_000)
    runs = [driven(d, true) for d in ("ccw", "cw")]
    start = estimate_closed_form([closing_of(run, NOMINAL) for run in runs], SIDE, NOMINAL)
    found = refine_on_tracks(runs, start, 50_000)
    assert all(closing_of(run, found.geometry(50_000)).distance < 1e-5 for run in runs)
    assert found.wheel_base == pytest.approx(base, abs=1e-7)


def test_five_measured_runs_each_way_tell_their_own_scatter() -> None:
    rng = np.random.default_rng(7)
    exact = [closing_of(driven(d), NOMINAL) for d in ("ccw", "cw")]
    found = []
    for _ in range(300):
        measured = [
            Closing(c.direction, c.x + dx, c.y + dy)
            for c in exact
            for dx, dy in rng.normal(0.0, 0.005, (5, 2))
        ]
        found.append(estimate_closed_form(measured, SIDE, NOMINAL))
    told = np.mean([f.wheel_base_deviation for f in found])
    seen = np.std([f.wheel_base for f in found])
    # 300 trials: a standard deviation to 1/√600 = 4 %; the mean of the square root of 5-run scatters is 4 % low.
    assert told == pytest.approx(seen, rel=0.15)
    assert np.mean([f.wheel_ratio_deviation for f in found]) == pytest.approx(
        np.std([f.wheel_ratio for f in found]), rel=0.15
    )


def test_a_tape_measure_of_two_millimetres_is_enough_for_the_criterion() -> None:
    closings = [closing_of(driven(d), NOMINAL) for d in ("ccw", "cw")]
    found = estimate_closed_form(closings, SIDE, NOMINAL, measured_deviation=0.002)
    assert 0.0 < found.wheel_base_deviation < 0.1e-3
    assert 0.0 < found.wheel_ratio_deviation < 1e-4


def test_one_direction_alone_is_refused() -> None:
    with pytest.raises(CalibrationError, match="no cw run"):
        estimate_closed_form([Closing("ccw", 0.2, -0.2)], SIDE, NOMINAL)
    start = Calibration(0.34, 1.0, 0.0, 0.0)
    straight = Run("ccw", [(0, 0), (200_000, 200_000)], Pose(4.0, 0.02, 0.01))
    with pytest.raises(CalibrationError, match="apart"):
        refine_on_tracks([straight], start, 50_000)


@pytest.mark.parametrize(
    ("closings", "told"),
    [
        ([Closing("ccw", 226.2, -205.4), Closing("cw", -10.3, -10.5)], "check their unit"),
        ([Closing("ccw", float("nan"), 0.0), Closing("cw", 0.0, 0.0)], "not a finite number"),
    ],
)
def test_closing_errors_in_millimetres_or_not_numbers_are_noticed(closings: list[Closing], told: str) -> None:
    with pytest.raises(CalibrationError, match=told):
        estimate_closed_form(closings, SIDE, NOMINAL)
