"""The limit switches: what they stop, what they refuse, how to come off them (docs/protocols, the board)."""

from math import radians

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
NEGATIVE, POSITIVE, HOME, FAULT, LIMIT_LATCHED, STOP_LATCHED, FAULT_LATCHED = (1 << n for n in range(7))
EYE = 18482.5


class TestLimit:
    @pytest.mark.parametrize("side", ["negative", "positive"])
    @pytest.mark.parametrize("mode", [1, 2, 3])
    def test_either_switch_sends_an_axis_in_control_idle_and_latches(self, rig, side, mode):
        rig.enter(mode)
        rig.close(side)
        shown = rig.snapshot()
        assert shown.inputs & (NEGATIVE | POSITIVE | LIMIT_LATCHED) == LIMIT_LATCHED | (
            NEGATIVE if side == "negative" else POSITIVE
        )
        assert (shown.status & 0x80, shown.flags & 2, shown.motor) == (0, 2, 0x80)
        assert rig.settings().mode == IDLE
        rig.run(0.01)
        (event,) = rig.events()
        assert (event.operation, event.axis, event.detail) == (0x41, 0, shown.inputs)

    def test_driving_onto_a_switch_stops_with_the_next_sample(self, rig):
        rig.inject("place", axis="left_vergence", angle=radians(39.9))
        rig.enter(INTEGRAL)
        rig.velocity(20)
        rig.run(0.1)
        (event,) = rig.events(0x41)
        assert event.time_us % 2048 == 0
        # 0.1° and some; the sample of the event saw at most one period's 20 counts of it and a few of lag.
        start = round(radians(39.9) * EYE)
        assert 0 <= event.position - (round(radians(40) * EYE) - start) - start <= 25
        assert rig.snapshot().motor == 0x80

    def test_flags_of_the_mode_stay_for_the_host_to_see(self, rig):
        rig.enter(INTEGRAL)
        rig.close()
        assert rig.snapshot().flags == 0x22

    def test_in_idle_a_triggered_one_makes_the_axis_go_idle_too(self, rig):
        rig.watchdog(1000)
        rig.write(0x08, 0x84, 3)
        rig.ok(0x1D, [1], 0)
        rig.close()
        assert rig.read(0x08, 2) == b"\x80\x00"
        assert rig.ok(0x21, axis=0)[0] == 0

    def test_it_acts_once_and_does_not_repeat_while_latched(self, rig):
        rig.close()
        rig.run(0.01)
        assert len(rig.events(0x41)) == 1
        rig.ok(0x1D, [1], 0)
        rig.close(held="free")
        rig.close()
        rig.run(0.01)
        assert rig.events(0x41) == []
        assert rig.ok(0x21, axis=0)[0] == 1

    def test_while_latched_whatever_could_move_answers_8(self, rig):
        rig.filter()
        rig.watchdog(60000)
        rig.close()
        assert set().union(*rig.drives().values()) == {8}

    def test_other_axes_are_not_held_by_it(self, rig):
        rig.close()
        rig.enter(POSITION, 1)

    def test_stays_until_clear_with_the_pin_high(self, rig):
        rig.close()
        rig.ok(0x06, axis=0)
        assert rig.inputs() & LIMIT_LATCHED
        rig.close(held="free")
        assert rig.inputs() & LIMIT_LATCHED
        rig.ok(0x06, axis=0)
        assert not rig.inputs() & LIMIT_LATCHED
        rig.enter(POSITION)

    def test_mode_0_stop_clear_reads_and_settings_are_never_refused(self, rig):
        rig.close()
        assert rig.never_refused() == {0}

    def test_to_back_off_disable_clear_mode_move_and_enable_when_open(self, rig):
        rig.inject("place", axis="left_vergence", angle=radians(40.5))
        assert rig.inputs() & (POSITIVE | LIMIT_LATCHED) == POSITIVE | LIMIT_LATCHED
        rig.filter()
        assert rig.status(0x16, [1]) == 8
        rig.ok(0x1E, [0], 0)
        assert rig.status(0x16, [1]) == 8
        rig.ok(0x06, axis=0)
        rig.enter(POSITION)
        here = rig.snapshot().actual
        rig.move(here - 400)
        rig.run(0.6)
        assert rig.inputs() & (POSITIVE | LIMIT_LATCHED) == 0
        rig.ok(0x1E, [1], 0)
        assert rig.settings() == (POSITION, 0, 1, 0)

    def test_with_the_limit_disabled_the_amplifier_still_does_not_drive_into_the_switch(self, rig):
        rig.inject("place", axis="left_vergence", angle=radians(40.5))
        rig.ok(0x1E, [0], 0)
        rig.ok(0x06, axis=0)
        rig.enter(POSITION)
        before = rig.snapshot().actual
        rig.command(before + 500)
        rig.run(0.3)
        assert rig.snapshot().actual == before

    def test_enabling_it_on_a_closed_switch_triggers_it_at_once(self, rig):
        rig.ok(0x1E, [0], 0)
        rig.close()
        assert not rig.inputs() & LIMIT_LATCHED
        rig.enter(POSITION)
        rig.ok(0x1E, [1], 0)
        assert rig.inputs() & LIMIT_LATCHED
        assert rig.settings().mode == IDLE

    def test_disabling_it_in_control_answers_6_and_a_wrong_value_4(self, rig):
        assert rig.status(0x1E, [2]) == 4
        rig.enter(POSITION)
        assert rig.status(0x1E, [0]) == 6
        assert rig.status(0x1E, [1]) == 0

    def test_going_idle_enables_it_again(self, rig):
        rig.ok(0x1E, [0], 0)
        assert rig.settings().limit_enable == 0
        rig.close()
        rig.ok(0x16, [0], 0)
        assert rig.settings().limit_enable == 1
        assert rig.inputs() & LIMIT_LATCHED

    def test_switches_of_the_mirrored_eye_go_by_counts(self, rig):
        rig.inject("place", axis="right_vergence", angle=radians(-40.5))
        assert rig.inputs(1) & (POSITIVE | NEGATIVE) == POSITIVE
        rig.inject("place", axis="right_vergence", angle=radians(40.5))
        assert rig.inputs(1) & (POSITIVE | NEGATIVE) == NEGATIVE
