"""Amplifier fault, emergency stop, CLEAR (docs/protocols, the board)."""

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
NEGATIVE, POSITIVE, HOME, FAULT, LIMIT_LATCHED, STOP_LATCHED, FAULT_LATCHED = (1 << n for n in range(7))
EYE = 18482.5


class TestAmplifierFault:
    def test_sends_the_axis_idle_latches_and_raises_event_48(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(10)
        rig.run_samples(20)
        actual = rig.snapshot().actual
        rig.inject("amplifier_fault", axis="left_vergence", fault="short_circuit")
        time_us = round(rig.t * 1e6)
        shown = rig.snapshot()
        assert shown.inputs & (FAULT | FAULT_LATCHED) == FAULT | FAULT_LATCHED
        assert (rig.settings().mode, shown.motor) == (IDLE, 0x80)
        rig.run(0.01)
        assert rig.events() == [(0x48, 0, time_us, actual, shown.inputs)]

    def test_while_latched_whatever_could_move_answers_8(self, rig):
        rig.filter()
        rig.watchdog(60000)
        rig.inject("amplifier_fault", axis="left_vergence")
        assert set().union(*rig.drives().values()) == {8}
        assert rig.never_refused() == {0}

    def test_stays_until_clear_with_the_input_gone(self, rig):
        rig.inject("amplifier_fault", axis="left_vergence")
        rig.ok(0x06, axis=0)
        assert rig.inputs() & FAULT_LATCHED
        rig.inject("amplifier_fault", axis="left_vergence", on=False)
        # The amplifier itself still latches it.
        assert rig.inputs() & FAULT
        for word in (b"\0\x10", b"\0\0"):
            rig.machine.amplifiers["left_vergence"].write(1, 0, word)
        assert rig.inputs() & (FAULT | FAULT_LATCHED) == FAULT_LATCHED
        rig.ok(0x06, axis=0)
        assert rig.inputs() & (FAULT | FAULT_LATCHED) == 0

    def test_a_commanded_inhibit_and_was_reset_do_not_raise_it(self, rig):
        rig.machine.amplifiers["left_vergence"].write(1, 0, b"\x01\0")
        rig.inject("restart_amplifier", axis="left_vergence")
        assert rig.inputs() & (FAULT | FAULT_LATCHED) == 0


class TestEmergencyStop:
    def test_sends_all_axes_idle_latches_and_raises_event_43_once(self, rig):
        for axis in range(3):
            rig.enter(POSITION, axis)
        rig.ok(0x05)
        time_us = round(rig.t * 1e6)
        rig.ok(0x05)
        assert rig.events() == [(0x43, WHOLE, time_us, 0, 0)]
        for axis in range(3):
            assert rig.settings(axis).mode == IDLE
            assert rig.inputs(axis) & STOP_LATCHED

    def test_whatever_could_move_answers_9_on_every_axis_also_before_8(self, rig):
        rig.filter()
        rig.watchdog(60000)
        rig.close()
        rig.ok(0x05)
        assert set().union(*rig.drives().values()) == {9}
        assert rig.status(0x16, [1], 2) == 9
        assert rig.never_refused() == {0}

    @pytest.mark.parametrize("axis", [0, 2, WHOLE])
    def test_clear_releases_it_on_all_axes_whichever_it_names(self, rig, axis):
        rig.ok(0x05)
        rig.ok(0x06, axis=axis)
        assert [rig.inputs(axis) & STOP_LATCHED for axis in range(3)] == [0, 0, 0]

    def test_the_button_does_the_same(self, rig):
        rig.enter(POSITION)
        rig.inject("emergency_stop", board=1)
        assert rig.inputs() & STOP_LATCHED
        assert [event.operation for event in rig.events()] == [0x43]


class TestClear:
    @pytest.mark.parametrize("axis", [3, 0x0E, 0x10])
    def test_a_bad_axis_answers_2(self, rig, axis):
        assert rig.status(0x06, axis=axis) == 2

    def test_of_one_axis_leaves_the_others_latches(self, rig):
        for name in ("left_vergence", "right_vergence"):
            rig.close(axis=name)
            rig.close(axis=name, held="free")
        rig.ok(0x06, axis=1)
        assert [rig.inputs(axis) & LIMIT_LATCHED for axis in (0, 1)] == [LIMIT_LATCHED, 0]
        rig.ok(0x06)
        assert rig.inputs(0) & LIMIT_LATCHED == 0

    def test_moves_nothing_and_leaves_the_mode(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.ok(0x06)
        assert rig.settings().mode == INTEGRAL
