"""The motor and its power stage against the closed forms of the plant (docs/protocols; equations §1.2)."""

from math import exp, radians

import pytest

from sim_devices.motor import Bridge, MotorConstants

T_M, C, E = 16.020856e-3, 1235.08619, 18482.5
STOP, SWITCH, EDGE = 14516.0, 12903.0, -4839.0
EYE = {"time_constant": T_M, "gain": C, "counts_per_radian": E, "amplifier_gain": 1.0}
TILT = {
    "time_constant": 13.578841e-3,
    "gain": 1013.86549,
    "counts_per_radian": 31831.0,
    "amplifier_gain": 1.95,
}
PAN = {
    "time_constant": 7.835792e-3,
    "gain": 431.30146,
    "counts_per_radian": 15915.5,
    "amplifier_gain": 3.56,
}
# Doubles carry 10⁻¹⁶ of some 10⁴ counts; sums of a few hundred steps stay far inside this.
EXACT = 1e-6


class TestMotor:
    @pytest.mark.parametrize(("constants", "speed"), [(EYE, 486.2), (TILT, 231.8), (PAN, 197.2)])
    def test_full_command_gives_the_speed_of_the_table(self, constants, speed, make_joint):
        joint = make_joint(constants=constants)
        joint.drive(127)
        # Printed to 0.1 °/s.
        assert joint.motor.target / constants["counts_per_radian"] == pytest.approx(radians(speed), rel=2e-4)

    @pytest.mark.parametrize(("constants", "k_e"), [(EYE, 1.16911), (TILT, 4.78293), (PAN, 10.26312)])
    def test_the_back_emf_constant_is_that_of_the_table(self, constants, k_e):
        # Printed to six digits, from E to five.
        assert MotorConstants(**constants).back_emf == pytest.approx(k_e, rel=1e-5)

    @pytest.mark.parametrize("steps", [1, 7, 100])
    def test_a_step_of_command_is_the_exponential_whatever_the_steps(self, steps, make_joint):
        joint = make_joint()
        joint.drive(50)
        t = 0.05
        for n in range(1, steps + 1):
            joint.advance_to(t * n / steps)
        u = 50 * C
        assert joint.w == pytest.approx(u * (1 - exp(-t / T_M)), abs=EXACT)
        assert joint.m == pytest.approx(u * (t - T_M * (1 - exp(-t / T_M))), abs=EXACT)

    @pytest.mark.parametrize(
        ("state", "time_constant"),
        [(Bridge.ENABLED, T_M), (Bridge.BRAKED, T_M), (Bridge.INHIBITED, 10 * T_M)],
    )
    def test_without_drive_the_speed_decays(self, state, time_constant, make_joint, bridge):
        joint = make_joint()
        joint.w = 5000.0
        bridge(joint, state)
        joint.advance_to(0.02)
        assert joint.w == pytest.approx(5000 * exp(-0.02 / time_constant), abs=EXACT)

    def test_an_inhibited_or_braked_or_stopped_bridge_hears_no_command(self, make_joint, bridge):
        for state, held in ((Bridge.INHIBITED, False), (Bridge.BRAKED, False), (Bridge.ENABLED, True)):
            joint = make_joint()
            joint.motor.held_at_zero = held
            bridge(joint, state)
            joint.drive(100)
            joint.advance_to(0.1)
            assert (joint.w, joint.m) == (0.0, 0.0)

    def test_the_bus_clamps_the_output(self, make_joint):
        # 24 V would cut pan's range: 24 V/K_E = 134.0°/s instead of 197.2.
        joint = make_joint(constants=PAN, bus=24.0)
        joint.drive(127)
        assert joint.motor.target / 15915.5 == pytest.approx(24 / 10.26312, rel=1e-5)
        # 86 counts are 23.918 V, under the bus; 87 would be 24.2 V.
        joint.drive(86)
        assert joint.motor.target == pytest.approx(86 * 431.30146)

    def test_at_48_v_neither_clamp_nor_current_limit_can_act(self, make_joint):
        for constants in (EYE, TILT, PAN):
            joint = make_joint(constants=constants)
            assert not joint.motor.limit_can_act
            for command in (-128, -1, 0, 1, 127):
                joint.drive(command)
                assert joint.motor.target == pytest.approx(command * constants["gain"])


class TestCurrent:
    def test_a_stalled_motor_draws_its_voltage_over_r(self, make_joint):
        joint = make_joint(constants=PAN)
        joint.drive(127)
        # 127·20/256·3.56 V over 4 Ω.
        assert joint.motor.current(0.0) == pytest.approx(127 * 20 / 256 * 3.56 / 4)
        assert joint.motor.current(joint.motor.target) == 0.0

    def test_the_peak_limits_the_torque_until_the_back_emf_relieves_it(self, make_joint):
        # 1 A against 2.48 A asked for: constant torque until u − w is 1 A's worth.
        joint = make_joint(peak=1.0, continuous=1.0)
        joint.drive(127)
        u = 127 * C
        limit = 1.0 * 4.0 / (127 * 20 / 256) * u
        joint.advance_to(0.01)
        assert joint.w == pytest.approx(limit * 0.01 / T_M, rel=1e-9)
        assert joint.motor.current(joint.w) == pytest.approx(1.0)
        uniform = (u - limit) * T_M / limit
        joint.advance_to(uniform + 0.005)
        assert joint.w == pytest.approx(u - limit * exp(-0.005 / T_M), rel=1e-9)

    def test_after_two_seconds_it_folds_back_to_the_continuous_one_and_recovers_when_relieved(
        self, make_joint
    ):
        joint = make_joint(position=STOP - 1e-3, peak=2.0, continuous=0.5)
        joint.forced_positive = False
        joint.refresh()
        joint.drive(100)
        for n in range(1, 199):
            joint.advance_to(n * 0.01)
        assert joint.motor.current(joint.w) == pytest.approx(100 * 20 / 256 / 4)
        for n in range(199, 203):
            joint.advance_to(n * 0.01)
        assert joint.motor.folded
        assert joint.motor.current(joint.w) == pytest.approx(0.5)
        assert joint.motor.demand(joint.w) == pytest.approx(100 * 20 / 256 / 4)
        joint.drive(10)
        joint.advance_to(2.04)
        assert not joint.motor.folded

    def test_current_limits_out_of_order_are_refused(self, make_joint):
        with pytest.raises(ValueError, match="continuous <= peak"):
            make_joint(peak=1.0, continuous=2.0)
