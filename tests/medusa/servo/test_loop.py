"""The quantised loop against the figures of equations page 1.3, 1.6 and 1.7 and against exact solutions."""

import math

import numpy as np
import pytest

from medusa.servo.loop import (
    MotorModel,
    simulate_batch,
    simulate_linear,
    simulate_position,
    simulate_proportional_velocity,
)
from medusa.servo.plant import Plant
from medusa.servo.position_filter import FilterRegisters, design_double_pole, nearest_registers
from medusa.servo.response import step_figures
from medusa.servo.thesis import JOINTS, PERIOD

# rise, overshoot in counts, settling: ms; page 1.6, of the shaft, starting on an encoder edge.
STEPS = {
    ("vergence", 100): (6.9, 2.1, 22.5),
    ("vergence", 1000): (35.6, 0.2, 65.5),
    ("vergence", 10000): (61.5, 0.2, 104.5),
    ("tilt", 100): (7.2, 2.2, 30.7),
    ("tilt", 1000): (31.3, 0.1, 59.4),
    ("tilt", 10000): (67.9, 0.0, 108.5),
    ("pan", 100): (12.7, 0.1, 24.6),
    ("pan", 1000): (23.7, 0.2, 43.0),
    ("pan", 10000): (146.3, 0.1, 190.5),
}


def nearest(name: str) -> FilterRegisters:
    return nearest_registers(design_double_pole(JOINTS[name].plant.discretise(PERIOD)), 255)


@pytest.mark.parametrize(("name", "step"), STEPS)
def test_quantised_steps_have_the_figures_of_the_page(name: str, step: int) -> None:
    record = simulate_position(JOINTS[name].plant, nearest(name), [step] * 200)
    figures = step_figures(record.time, record.shaft, step)
    rise, overshoot, settling = STEPS[name, step]
    assert figures.rise * 1e3 == pytest.approx(rise, abs=0.06)  # last digit on the page
    assert figures.overshoot == pytest.approx(overshoot, abs=0.06)
    assert figures.settling * 1e3 == pytest.approx(settling, abs=0.06)
    assert (
        np.abs(record.error[-50:]).max() <= {"vergence": 8, "tilt": 6, "pan": 3}[name]
    )  # dead band, page 1.6


@pytest.mark.parametrize("name", JOINTS)
def test_linear_step_does_not_overshoot_and_settles_in_seven_samples(name: str) -> None:
    joint = JOINTS[name]
    y = simulate_linear(joint.plant, joint.printed_pole, 0.0, joint.printed_filter.gain, PERIOD, np.ones(40))
    figures = step_figures(np.arange(40) * PERIOD, y, 1.0)
    assert figures.overshoot <= 1e-4  # the tilt's printed K leaves a complex pair, page 1.3
    assert figures.rise * 1e3 == pytest.approx(8.2, abs=0.3)
    assert figures.settling * 1e3 == pytest.approx(14.336)
    assert step_figures(np.arange(40) * PERIOD, y, 1.0, band=0.01).settling * 1e3 == pytest.approx(16.384)


def test_linear_vergence_step_goes_through_the_six_values_of_the_page() -> None:
    joint = JOINTS["vergence"]
    y = simulate_linear(joint.plant, joint.printed_pole, 0.0, joint.printed_filter.gain, PERIOD, np.ones(8))
    assert y[1:7] == pytest.approx([0.1767, 0.4915, 0.7208, 0.8562, 0.9289, 0.9658], abs=5e-5)


@pytest.mark.parametrize(
    ("name", "fast", "slow"), [("vergence", 0.877, 0.847), ("tilt", 0.859, 0.858), ("pan", 0.766, 0.754)]
)
def test_proportional_velocity_reaches_the_share_of_the_command_on_the_page(
    name: str, fast: float, slow: float
) -> None:
    joint = JOINTS[name]
    # K of (iii) to the printed decimal, 2.9, 3.0 and 3.8, is no byte: the page's simulation takes it times 4.
    gain = joint.printed_velocity_gains[2] * 4
    for degrees, ratio in ((60.0, fast), (10.0, slow)):
        vc = round(degrees * joint.counts_per_degree * PERIOD * 16)
        record = simulate_proportional_velocity(joint.plant, round(gain), [vc] * 500, PERIOD)
        travelled = (record.shaft[-1] - record.shaft[100]) / 399
        # The byte differs from the page's K by up to 3.5 %, the ratio by (1 − ratio) times that, and truncation
        # takes up to one DAC count.
        assert travelled * 16 / vc == pytest.approx(ratio, abs=0.012)


def test_ramp_is_followed_speed_over_velocity_constant_behind() -> None:
    joint = JOINTS["vergence"]
    speed = round(60 * joint.counts_per_degree * PERIOD)  # counts a sample
    record = simulate_position(joint.plant, nearest("vergence"), [speed * n for n in range(300)])
    lag = record.error[-20:].mean()
    # v/K_v with K_v = 187 1/s of the nearest registers (page 1.6), up to 1 DAC count/D(1) = 6.6 more by truncation,
    # and half a count by the encoder's floor.
    assert speed / PERIOD / 187 - 1 <= lag <= speed / PERIOD / 187 + 6.6 + 1


def test_motor_with_friction_stays_at_rest_below_it_and_coasts_to_rest() -> None:
    motor = MotorModel(0.016, 1235.0, 0.002, friction=2.0)
    for value in (1, 2, -2, 0):
        motor.advance(np.asarray(value, dtype=np.int64))
        assert motor.position == 0.0
    motor.advance(np.asarray(50, dtype=np.int64))
    running = float(motor.velocity)
    assert running == pytest.approx(1235.0 * 48 * (1 - math.exp(-0.002 / 0.016)))
    # Coasting at DAC 0 the speed goes through zero after T_M ln(1 + v/(C f)): then it rests.
    rest = 0.016 * math.log(1 + running / (1235.0 * 2))
    for _ in range(math.ceil(rest / 0.002)):
        motor.advance(np.asarray(0, dtype=np.int64))
    assert motor.velocity == 0.0
    travelled = running * 0.016 - 1235.0 * 2 * rest
    start = 1235.0 * 48 * (0.002 - 0.016 * (1 - math.exp(-0.002 / 0.016)))
    assert float(motor.position) == pytest.approx(start + travelled)


def test_motor_with_friction_turns_within_a_sample_as_in_small_steps() -> None:
    coarse = MotorModel(0.016, 1235.0, 0.002, friction=2.0)
    fine = MotorModel(0.016, 1235.0, 1e-6, friction=2.0)
    for value in (40, -60, -60, 30, 1):
        coarse.advance(np.asarray(value, dtype=np.int64))
        for _ in range(2000):
            fine.advance(np.asarray(value, dtype=np.int64))
        # The friction of one microsecond step may have the wrong sign: C f T/T_M per turn and step.
        assert float(coarse.velocity) == pytest.approx(float(fine.velocity), abs=0.5)
        assert float(coarse.position) == pytest.approx(float(fine.position), abs=0.01)


def test_a_batch_gives_each_member_what_it_gets_alone() -> None:
    plants = [JOINTS[name].plant for name in JOINTS]
    registers = nearest("tilt")
    batch = simulate_batch(
        [p.time_constant for p in plants],
        [p.velocity_gain for p in plants],
        (registers.zero, registers.pole, registers.gain),
        PERIOD,
        [300] * 60,
        friction=1.0,
    )
    for i, plant in enumerate(plants):
        alone = simulate_position(plant, registers, [300] * 60, friction=1.0)
        assert np.array_equal(batch.counts[:, i], alone.counts)
        assert np.array_equal(batch.dac[:, i], alone.dac)


def test_dac_is_truncated_toward_zero_and_clamped() -> None:
    plant = Plant(1e3, 1e-9)  # practically at rest
    for step, expected in ((1, 1), (-1, -1), (3, 3), (90, 112), (200, 127), (-200, -128)):
        record = simulate_position(plant, FilterRegisters(0, 0, 5, 255), [step], start=0.5)
        assert record.dac[0] == expected  # trunc(1.25 X)
