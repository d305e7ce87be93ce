"""The plant against the printed models, the physical constants and its own differential equation."""

import math

import pytest

from medusa.servo.plant import K_D, Plant, encoder_gain
from medusa.servo.thesis import JOINTS, PERIOD

# T_M [ms], C [1/s], C T, unrounded b: equations page 1.2, six to eight digits printed there.
CONSTANTS = {
    "vergence": (16.020856, 1235.08619, 2.5294565, 0.958289),
    "tilt": (13.578841, 1013.86549, 2.0763965, 0.950977),
    "pan": (7.835792, 431.30146, 0.8833054, 0.916606),
}
# E [counts/rad], K_E [V s/rad], speed at DAC 127 [degrees/s].
SCALES = {
    "vergence": (18482.5, 1.16911, 486.2),
    "tilt": (31831.0, 4.78293, 231.8),
    "pan": (15915.5, 10.26312, 197.2),
}


@pytest.mark.parametrize("name", CONSTANTS)
def test_printed_pole_and_gain_give_the_time_constant_and_the_velocity_gain(name: str) -> None:
    time_constant, gain, reach, zero = CONSTANTS[name]
    plant = JOINTS[name].plant
    assert plant.time_constant * 1e3 == pytest.approx(time_constant, abs=5e-7)  # last printed digit
    assert plant.velocity_gain == pytest.approx(gain, abs=5e-6)
    assert plant.velocity_gain * PERIOD == pytest.approx(reach, abs=5e-8)
    assert plant.discretise(PERIOD).zero == pytest.approx(zero, abs=5e-7)


@pytest.mark.parametrize("name", CONSTANTS)
def test_discretisation_gives_back_what_6_8_to_6_10_print(name: str) -> None:
    joint = JOINTS[name]
    discrete = joint.plant.discretise(PERIOD)
    assert discrete.gain == pytest.approx(joint.printed_gain, rel=1e-12)  # float rounding only
    assert discrete.pole == pytest.approx(joint.printed_pole, rel=1e-12)
    assert round(discrete.zero, 2) == joint.printed_zero


@pytest.mark.parametrize("name", SCALES)
def test_encoder_gain_back_emf_and_top_speed_agree_with_the_table(name: str) -> None:
    encoder, back_emf, top = SCALES[name]
    joint = JOINTS[name]
    assert joint.counts_per_radian == pytest.approx(encoder, abs=0.05)  # last printed digit
    assert joint.plant.back_emf(joint.counts_per_radian, joint.amplifier_gain) == pytest.approx(
        back_emf, abs=6e-6
    )
    assert joint.plant.top_speed / joint.counts_per_degree == pytest.approx(top, abs=0.06)


@pytest.mark.parametrize("name", CONSTANTS)
def test_four_ohm_and_the_inertia_of_the_joint_give_the_same_plant(name: str) -> None:
    joint = JOINTS[name]
    resistance = 4.0  # the power stage's joint-referred R; K_T = K_E there
    back_emf = joint.plant.back_emf(joint.counts_per_radian, joint.amplifier_gain)
    inertia = joint.plant.inertia(resistance, back_emf, back_emf)
    again = Plant.from_constants(
        resistance, inertia, back_emf, back_emf, joint.counts_per_radian, joint.amplifier_gain
    )
    assert again.time_constant == pytest.approx(joint.plant.time_constant, rel=1e-12)
    assert again.velocity_gain == pytest.approx(joint.plant.velocity_gain, rel=1e-12)


def test_dac_factor_and_encoder_gain_follow_6_6_and_6_7() -> None:
    assert K_D == 0.078125
    assert encoder_gain(lines=500, gear=100) * 2 * math.pi == pytest.approx(200_000)  # 4 N G counts a turn


@pytest.mark.parametrize("period", [64e-6, 1e-3, 2.048e-3])
def test_discrete_plant_steps_like_the_continuous_one(period: float) -> None:
    plant = JOINTS["vergence"].plant
    discrete = plant.discretise(period)
    g, b, p = discrete.gain, discrete.zero, discrete.pole
    inputs = [1.0, 0.0, -3.0, 2.0, 2.0, 0.0]
    outputs = [0.0, 0.0]
    for n in range(len(inputs)):  # y[n+1] = (1 + p) y[n] − p y[n−1] + g u[n] + g b u[n−1]
        before = inputs[n - 1] if n else 0.0
        outputs.append((1 + p) * outputs[-1] - p * outputs[-2] + g * inputs[n] + g * b * before)
    position = velocity = 0.0
    for n, value in enumerate(inputs):
        position, velocity = plant.advance(position, velocity, value, period)
        assert outputs[n + 2] == pytest.approx(position, rel=1e-9, abs=1e-12)  # cancellation in g at 64 µs


def test_transfer_functions_are_those_of_6_8_and_6_17() -> None:
    discrete = JOINTS["tilt"].plant.discretise(PERIOD)
    position, velocity = discrete.position(), discrete.velocity()
    assert sorted(position.poles().real) == pytest.approx([discrete.pole, 1.0])
    assert position.zeros().real == pytest.approx([-discrete.zero])
    # (6.17): one DAC count ends at C T counts a sample
    assert velocity.dcgain() == pytest.approx(JOINTS["tilt"].plant.velocity_gain * PERIOD)


@pytest.mark.parametrize(
    ("time_constant", "gain"), [(0.0, 1.0), (0.01, -1.0), (math.nan, 1.0), (0.01, math.inf)]
)
def test_a_plant_without_positive_constants_is_refused(time_constant: float, gain: float) -> None:
    with pytest.raises(ValueError, match="must be positive"):
        Plant(time_constant, gain)
