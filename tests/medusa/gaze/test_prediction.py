"""The constant-velocity filter against closed forms, and its margins against the loop that they speak of."""

import math

import numpy as np
import pytest

from medusa.gaze.margins import pursuit_margins
from medusa.gaze.prediction import ConstantVelocityFilter, steady_gains


def test_a_constant_velocity_is_predicted_exactly_even_over_gaps():
    tracked = ConstantVelocityFilter(1e-6)
    for stamp in (0.0, 0.1, 0.15, 0.4, 0.5, 1.3, 1.4):
        tracked.update(stamp, 0.2 + 0.3 * stamp, 1e-4)
    # The prior's velocity of 0 ± 1 is forgotten by the ratio of the variances, about 1e-8.
    assert tracked.predict(2.0).value == pytest.approx(0.8, abs=1e-6)
    assert tracked.predict(2.0).rate == pytest.approx(0.3, abs=1e-6)


def test_the_stated_variance_is_that_of_the_errors():
    rng = np.random.default_rng(5)
    q, sigma, period = 0.5, 0.01, 0.1
    normalised = []
    for _ in range(400):
        tracked = ConstantVelocityFilter(q)
        x = v = 0.0
        for k in range(20):
            tracked.update(k * period, x + rng.normal(0, sigma), sigma)
            covariance = q * np.array([[period**3 / 3, period**2 / 2], [period**2 / 2, period]])
            jump = rng.multivariate_normal([0, 0], covariance)
            x, v = x + v * period + jump[0], v + jump[1]
        predicted = tracked.predict(20 * period)
        normalised.append((x - predicted.value) / math.sqrt(predicted.variance))
    # Standard deviation of a variance of 400 samples: √(2/400) = 7 %; four of them.
    assert np.mean(np.square(normalised)) == pytest.approx(1.0, abs=0.28)


def test_a_target_that_jumps_is_followed_anew_instead_of_averaged():
    tracked = ConstantVelocityFilter(0.1)
    for k in range(10):
        tracked.update(k * 0.1, 0.0, 0.001)
    tracked.update(1.0, 2.0, 0.001)
    assert tracked.predict(1.0).value == 2.0
    assert tracked.predict(1.5).value == 2.0


def test_what_is_older_than_the_last_measurement_is_refused():
    tracked = ConstantVelocityFilter(0.1)
    with pytest.raises(ValueError, match="nothing has been measured"):
        tracked.predict(0.0)
    tracked.update(1.0, 0.0, 0.01)
    with pytest.raises(ValueError, match="after one of"):
        tracked.update(0.9, 0.0, 0.01)


def test_the_settled_gains_are_those_of_the_alpha_beta_filter():
    # Kalata's relation for white acceleration: λ² = T³ q/σ² and the filter's α, β obey β² = λ²(1 − α) · (1 +
    # …) only for piecewise-constant acceleration; for the continuous model the filter itself is the
    # reference.
    q, sigma, period = 0.4, 0.002, 1 / 6
    tracked = ConstantVelocityFilter(q, gate=1e9)
    for k in range(200):
        tracked.update(k * period, 0.0, sigma)
    tracked.update(200 * period, 1.0, sigma)
    alpha, rate = steady_gains(q, sigma, period)
    assert tracked.predict(200 * period).value == pytest.approx(alpha, rel=1e-9)
    assert tracked.predict(200 * period).rate == pytest.approx(rate, rel=1e-9)


@pytest.mark.parametrize(
    ("frame_rate", "acceleration", "latency"), [(6, 0.05, 0.05), (25, 0.05, 0.02), (25, 0.4, 0.05)]
)
def test_the_gain_margin_is_where_the_loop_begins_to_ring(frame_rate, acceleration, latency):
    period, sigma = 1 / frame_rate, 0.002
    margin = pursuit_margins(acceleration, sigma, period, latency).gain
    frames = 1 + math.floor(latency / period + 1e-9)

    def error_after(scale):
        """Retinal errors, measured `scale` times too large, of a gaze that is disturbed once and then only predicts."""
        tracked = ConstantVelocityFilter(acceleration, gate=1e9)
        for k in range(400):  # to the settled gains
            tracked.update((k - 400) * period, 0.0, sigma)
        gaze = [0.01] * frames
        for k in range(600):
            tracked.update(k * period, gaze[k] + scale * (0.0 - gaze[k]), sigma)
            gaze.append(tracked.predict((k + frames) * period).value)
        return max(abs(g) for g in gaze[-50:])

    # Two per cent to either side of the margin tell decay from growth in 600 pictures.
    assert error_after(0.98 * margin) < 0.01
    assert error_after(1.02 * margin) > 0.01


def test_agility_calms_a_filter_at_rest_and_rouses_it_at_a_turn():
    rng = np.random.default_rng(3)
    sigma, period = 1e-3, 1 / 25

    def run(agility):
        tracked = ConstantVelocityFilter(0.1, agility=agility, gate=1e9)
        resting, turning = [], []
        for k in range(200):
            # At rest for 4 s, then suddenly at 0.35 rad/s (20 degrees a second).
            place = 0.0 if k < 100 else 0.35 * (k - 100) * period
            tracked.update(k * period, place + sigma * rng.standard_normal(), sigma)
            rate = tracked.predict(k * period).rate
            if 50 <= k < 100:
                resting.append(rate)
            if 105 <= k < 110:
                turning.append(rate - 0.35)
        return np.std(resting), np.abs(turning).max()

    fixed, adaptive = run((1.0, 1.0)), run((0.02, 10.0))
    # A fiftieth of q takes some half of the velocity's noise away; five pictures after the turn both follow.
    assert adaptive[0] < 0.6 * fixed[0]
    assert adaptive[1] < fixed[1] + 0.02


def test_a_halted_path_rests_where_it_was_last_seen():
    tracked = ConstantVelocityFilter(0.1)
    for k in range(10):
        tracked.update(0.1 * k, 0.05 * k, 1e-4)
    assert tracked.predict(1.4).value == pytest.approx(0.7, abs=1e-3)
    tracked.halt()
    assert tracked.predict(1.4).value == pytest.approx(0.45, abs=1e-3)


@pytest.mark.parametrize("agility", [(0.0, 2.0), (2.0, 3.0), (0.5, 0.9)])
def test_an_agility_that_does_not_include_the_nominal_is_refused(agility):
    with pytest.raises(ValueError, match="agility"):
        ConstantVelocityFilter(0.1, agility=agility)
