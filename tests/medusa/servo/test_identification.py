"""Estimation of T_M, C and friction from pulses made by the differential equation itself."""

import math

import numpy as np
import pytest

from medusa.errors import CommandError
from medusa.servo.identification import Pulse, estimate_plant, pulse_position
from medusa.servo.plant import Plant
from medusa.servo.thesis import JOINTS

LINE_PERIOD = 5e-3  # a SNAPSHOT and its reply take about this long at 115200 baud


def integrate(
    plant: Plant, dac: float, friction: float, on: float, off: float, times: np.ndarray
) -> np.ndarray:
    """Euler steps of 2 µs of T_M v' = C (u − f sign v) − v, at rest while |u| ≤ f."""
    step = 2e-6
    position = velocity = t = 0.0
    out = []
    for time in times:
        while t < time:
            u = dac if on <= t < off else 0.0
            if velocity == 0.0 and abs(u) <= friction:
                t = time if t >= off else t + step
                continue
            way = math.copysign(1.0, velocity) if velocity != 0.0 else math.copysign(1.0, u)
            after = (
                velocity
                + step * (plant.velocity_gain * (u - friction * way) - velocity) / plant.time_constant
            )
            velocity = 0.0 if velocity * after < 0 else after
            position += velocity * step
            t += step
        out.append(position)
    return np.array(out)


def make_pulse(plant: Plant, dac: int, rng: np.random.Generator, *, friction: float = 0.0) -> Pulse:
    on = 0.02 + rng.uniform(0, LINE_PERIOD)
    off = on + 0.15
    time = np.arange(0, off + 0.4, LINE_PERIOD)
    exact = pulse_position(time, dac, plant.time_constant, plant.velocity_gain, friction, on, off)
    counts = np.floor(exact + rng.uniform(0, 1))
    return Pulse(dac, time, counts, np.where((time >= on) & (time < off), dac, 0))


@pytest.mark.parametrize("friction", [0.0, 2.0])
def test_pulse_position_solves_the_differential_equation(friction: float) -> None:
    plant = Plant(0.0136, 1013.9)
    times = np.arange(0.0, 0.25, 0.01)
    exact = pulse_position(times, -9, plant.time_constant, plant.velocity_gain, friction, 0.0101, 0.08)
    # Euler errs by about step/T_M of the way: 1.5e-4 of 600 counts.
    assert exact == pytest.approx(integrate(plant, -9, friction, 0.0101, 0.08, times), abs=0.2)


@pytest.mark.parametrize("friction", [0.0, 2.0])
@pytest.mark.parametrize("name", JOINTS)
def test_the_plant_is_found_within_its_stated_uncertainty(name: str, friction: float) -> None:
    plant = JOINTS[name].plant
    rng = np.random.default_rng(3)
    found = estimate_plant([make_pulse(plant, d, rng, friction=friction) for d in (16, -16, 8, -8) * 2])
    error = abs(found.plant.time_constant - plant.time_constant)
    assert error < 0.01 * plant.time_constant  # 3 % is asked for; whole counts leave less than 1 %
    # The stated uncertainty is two standard deviations; three of them hold in all but 0.3 % of the cases.
    assert error <= 1.5 * found.time_constant_error
    assert abs(found.plant.velocity_gain - plant.velocity_gain) < 1e-3 * plant.velocity_gain
    assert found.friction_dac == pytest.approx(friction, abs=0.02)
    assert abs(found.asymmetry) < 2e-3
    assert found.residual_counts < 0.35  # the encoder's own is 1/√12 = 0.29


def test_a_joint_that_moves_less_one_way_shows_its_asymmetry() -> None:
    rng = np.random.default_rng(5)
    forth, back = Plant(0.016, 1300.0), Plant(0.016, 1170.0)
    pulses = [make_pulse(forth if d > 0 else back, d, rng) for d in (16, -16, 8, -8)]
    found = estimate_plant(pulses)
    assert found.asymmetry == pytest.approx(130 / 1235, abs=2e-3)
    assert found.forward.velocity_gain == pytest.approx(1300, rel=2e-3)
    assert found.backward.velocity_gain == pytest.approx(1170, rel=2e-3)


def test_what_the_model_leaves_out_widens_the_stated_uncertainty() -> None:
    plant = JOINTS["vergence"].plant
    rng = np.random.default_rng(7)
    clean = [make_pulse(plant, d, rng) for d in (16, -16, 8, -8)]
    wobbling = [
        Pulse(p.dac, p.time, p.counts + np.round(5 * np.sin(300 * p.time)), p.shown_dac) for p in clean
    ]
    assert estimate_plant(wobbling).time_constant_error > 3 * estimate_plant(clean).time_constant_error


def test_one_size_of_pulse_does_not_separate_friction_from_gain_and_is_refused() -> None:
    rng = np.random.default_rng(1)
    plant = JOINTS["pan"].plant
    with pytest.raises(CommandError, match=r"1 size\(s\) of negative pulses, 2 are needed"):
        estimate_plant([make_pulse(plant, d, rng) for d in (16, 8, -8)])


def test_a_joint_that_stood_still_is_refused() -> None:
    time = np.arange(0, 0.3, LINE_PERIOD)
    pulses = [
        Pulse(d, time, np.zeros_like(time), np.where((time > 0.05) & (time < 0.2), d, 0))
        for d in (4, -4, 2, -2)
    ]
    with pytest.raises(CommandError, match="did not move"):
        estimate_plant(pulses)


def test_a_pulse_that_was_never_seen_or_is_zero_is_refused() -> None:
    time = np.arange(0, 0.1, LINE_PERIOD)
    unseen = Pulse(5, time, np.zeros_like(time), np.zeros(len(time), dtype=np.int64))
    with pytest.raises(CommandError, match="shows no beginning"):
        _ = unseen.on_bracket
    endless = Pulse(5, time, np.zeros_like(time), np.where(time > 0.05, 5, 0))
    with pytest.raises(CommandError, match="shows no end"):
        _ = endless.off_bracket
    with pytest.raises(ValueError, match="moves nothing"):
        Pulse(0, time, time, unseen.shown_dac)
