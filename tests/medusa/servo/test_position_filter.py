"""The position filter against equations page 1.3 and 1.5 and closed forms."""

import numpy as np
import pytest

from medusa.errors import CommandError
from medusa.servo.position_filter import (
    Filter,
    FilterRegisters,
    characteristic_polynomial,
    check_stable,
    closed_loop_poles,
    compensated_gain_limit,
    dead_band,
    design_double_pole,
    double_pole_gains,
    floor_gain_registers,
    nearest_registers,
    uncompensated_breakaway,
    uncompensated_gain_limit,
    velocity_constant,
)
from medusa.servo.thesis import JOINTS, PERIOD

NAMES = ["vergence", "tilt", "pan"]
# K exact, double pole, K_max compensated, K_max uncompensated, breakaway K and z, re-entry K: page 1.3.
DESIGN = {
    "vergence": (1.14059, 0.4116, 6.732, 0.808, 0.01224, 0.93905, 36.5),
    "tilt": (1.19289, 0.4111, 7.057, 0.988, 0.01749, 0.92870, 37.8),
    "pan": (1.72025, 0.4088, 10.292, 2.367, 0.06932, 0.88133, 51.7),
}
# nearest K_r and A_r with their fast poles; the floor of K with its two fast poles: page 1.5.
BYTES = {
    "vergence": (5, 225, 0.4039 + 0.1504j, 0.8784, 4, (0.2484, 0.5983)),
    "tilt": (5, 220, 0.4074 + 0.1061j, 0.8590, 4, (0.2267, 0.6255)),
    "pan": (7, 197, 0.4078 + 0.0622j, 0.7689, 6, (0.2437, 0.5987)),
}


@pytest.mark.parametrize("name", NAMES)
def test_double_pole_design_gives_the_gains_of_6_12_to_6_14(name: str) -> None:
    gain, pole, stable, bare, breakaway, place, reentry = DESIGN[name]
    plant = JOINTS[name].plant.discretise(PERIOD)
    controller = design_double_pole(plant)
    assert controller.gain == pytest.approx(gain, abs=5e-6)  # last digit on the page
    assert controller.zero == plant.pole
    assert controller.pole == 0.0
    poles = closed_loop_poles(plant, controller)[1:]
    assert poles.real == pytest.approx([pole, pole], abs=5e-5)
    assert np.abs(poles.imag).max() < 1e-7  # a double root splits by the square root of the rounding
    assert compensated_gain_limit(plant) == pytest.approx(stable, abs=5e-4)
    assert uncompensated_gain_limit(plant) == pytest.approx(bare, abs=5e-4)
    assert uncompensated_breakaway(plant) == pytest.approx((breakaway, place), abs=5e-6)
    assert double_pole_gains(plant)[1] == pytest.approx(reentry, abs=0.05)


@pytest.mark.parametrize("name", NAMES)
def test_printed_gains_are_the_design_to_one_in_the_second_decimal(name: str) -> None:
    joint = JOINTS[name]
    controller = design_double_pole(joint.plant.discretise(PERIOD))
    # The print rounds b before K: 1.20 and 1.71 are printed where 1.19 and 1.72 come out.
    assert controller.gain == pytest.approx(joint.printed_filter.gain, abs=0.011)
    assert controller.zero == pytest.approx(joint.printed_filter.zero)


def test_poles_at_the_printed_gains_are_those_of_the_page() -> None:
    poles = {
        "vergence": (0.4229, 0.4004),
        "tilt": (0.4106 + 0.0380j, 0.4106 - 0.0380j),
        "pan": (0.4473, 0.3714),
    }
    for name, expected in poles.items():
        plant = JOINTS[name].plant.discretise(PERIOD)
        found = closed_loop_poles(plant, Filter(plant.pole, 0.0, JOINTS[name].printed_filter.gain))[1:]
        assert sorted(found, key=lambda z: (z.real, z.imag)) == pytest.approx(
            sorted(expected, key=lambda z: (complex(z).real, complex(z).imag)), abs=6e-5
        )


@pytest.mark.parametrize("name", NAMES)
def test_nearest_and_floor_registers_have_the_poles_of_the_page(name: str) -> None:
    gain, zero, fast, slow, floor, real = BYTES[name]
    plant = JOINTS[name].plant.discretise(PERIOD)
    near = nearest_registers(design_double_pole(plant), 255)
    assert (near.gain, near.zero, near.pole, near.timer) == (gain, zero, 0, 255)
    poles = closed_loop_poles(plant, near.filter)
    assert poles[0].real == pytest.approx(slow, abs=1e-4)
    assert max(poles[1:], key=lambda z: z.imag) == pytest.approx(fast, abs=1e-4)
    low = floor_gain_registers(design_double_pole(plant), 255)
    assert low.gain == floor
    assert sorted(closed_loop_poles(plant, low.filter).real)[:2] == pytest.approx(real, abs=1e-4)


def test_dead_bands_and_velocity_constants_are_those_of_the_page() -> None:
    design = {"vergence": (7.3, 169.0), "tilt": (6.0, 170.3), "pan": (2.5, 169.6)}  # at the printed K
    registers = {"vergence": (6.6, 187), "tilt": (5.7, 178), "pan": (2.5, 174)}
    for name in NAMES:
        plant = JOINTS[name].plant
        printed = JOINTS[name].printed_filter
        near = nearest_registers(design_double_pole(plant.discretise(PERIOD)), 255).filter
        assert dead_band(printed) == pytest.approx(design[name][0], abs=0.06)
        assert velocity_constant(plant.velocity_gain, printed) == pytest.approx(design[name][1], abs=0.1)
        assert dead_band(near) == pytest.approx(registers[name][0], abs=0.05)
        assert velocity_constant(plant.velocity_gain, near) == pytest.approx(registers[name][1], abs=0.5)


@pytest.mark.parametrize("name", NAMES)
def test_gain_limits_are_where_a_pole_crosses_the_unit_circle(name: str) -> None:
    plant = JOINTS[name].plant.discretise(PERIOD)
    limit = compensated_gain_limit(plant)
    check_stable(plant, Filter(plant.pole, 0.0, limit * 0.999))
    with pytest.raises(CommandError, match="unstable"):
        check_stable(plant, Filter(plant.pole, 0.0, limit * 1.001))
    bare = uncompensated_gain_limit(plant)
    check_stable(plant, Filter(0.0, 0.0, bare * 0.999))
    with pytest.raises(CommandError, match=r"a pole of magnitude 1\.\d+, allowed below 1"):
        check_stable(plant, Filter(0.0, 0.0, bare * 1.001))


def test_characteristic_polynomial_agrees_with_python_control() -> None:
    import control

    plant = JOINTS["pan"].plant.discretise(PERIOD)
    controller = Filter(0.8, 0.1, 1.5)
    loop = controller.transfer_function(PERIOD) * plant.position()
    theirs = control.feedback(loop).poles()
    ours = closed_loop_poles(plant, controller)
    assert np.sort_complex(ours) == pytest.approx(np.sort_complex(theirs), abs=1e-9)
    assert characteristic_polynomial(plant, controller)[0] == 1.0


@pytest.mark.parametrize("bytes_", [(256, 0, 5, 255), (225, -1, 5, 255), (225, 0, 300, 255), (225, 0, 5, 6)])
def test_registers_outside_a_byte_or_a_timer_below_seven_are_refused(
    bytes_: tuple[int, int, int, int],
) -> None:
    with pytest.raises(CommandError, match="outside"):
        FilterRegisters(*bytes_)
