"""LIMIT, amplifier fault, emergency stop, CLEAR, and the board's own LATCH (docs/protocols, the board)."""

import struct
from math import radians

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
NEGATIVE, POSITIVE, HOME, FAULT, LIMIT_LATCHED, STOP_LATCHED, FAULT_LATCHED = (1 << n for n in range(7))
EYE = 18482.5


def close(rig, side="positive", held="closed", axis="left_vergence"):
    rig.inject("switch", axis=axis, side=side, held=held)


def drives(rig):
    """Everything that could move an axis in idle, by its status."""
    return {
        "MODE": {rig.status(0x16, [mode]) for mode in (1, 2, 3)},
        "COMMAND": {rig.command(1)},
        "VELOCITY": {rig.velocity(1)},
        "MOVE": {rig.move(1, start=0), rig.move(1, start=1)},
        "START": {rig.status(0x1A, [1], WHOLE)},
        "08H": {rig.write(0x08, 0x90)},
        "09H": {rig.write(0x09, 1)},
        "0CH": {rig.write(0x0C, 0, 0, 1)},
        "23H": {rig.write(0x23, 1)},
        "3CH": {rig.write(0x3C, 1)},
        "00H": {rig.write(0x00, 0x08)},
        "05H": {rig.write(0x05, 3)},
    }


def never_refused(rig):
    """MODE 0, STOP, reads, settings: their statuses."""
    return {
        rig.status(0x16, [0]),
        rig.status(0x20),
        rig.status(0x10, [0x12, 3]),
        rig.status(0x12),
        rig.status(0x14, axis=WHOLE),
        rig.status(0x15, (225, 0, 5, 255)),
        rig.status(0x18, [0, 1, 10]),
        rig.status(0x1B, bytes(4)),
        rig.status(0x1C),
        rig.status(0x1D, [0]),
        rig.status(0x1F, [0, 0]),
        rig.status(0x21),
        rig.status(0x22),
        rig.write(0x08, 0x80, 0),
        rig.write(0x20, 225, 0, 5),
        rig.write(0x29, 1, 2, 3),
        rig.write(0x05, 1),
        rig.write(0x18, 1, 2, 3, 4),
    }


class TestLimit:
    @pytest.mark.parametrize("side", ["negative", "positive"])
    @pytest.mark.parametrize("mode", [1, 2, 3])
    def test_either_switch_sends_an_axis_in_control_idle_and_latches(self, rig, side, mode):
        rig.enter(mode)
        close(rig, side)
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
        close(rig)
        assert rig.snapshot().flags == 0x22

    def test_in_idle_a_triggered_one_makes_the_axis_go_idle_too(self, rig):
        rig.watchdog(1000)
        rig.write(0x08, 0x84, 3)
        rig.ok(0x1D, [1], 0)
        close(rig)
        assert rig.read(0x08, 2) == b"\x80\x00"
        assert rig.ok(0x21, axis=0)[0] == 0

    def test_it_acts_once_and_does_not_repeat_while_latched(self, rig):
        close(rig)
        rig.run(0.01)
        assert len(rig.events(0x41)) == 1
        rig.ok(0x1D, [1], 0)
        close(rig, held="free")
        close(rig)
        rig.run(0.01)
        assert rig.events(0x41) == []
        assert rig.ok(0x21, axis=0)[0] == 1

    def test_while_latched_whatever_could_move_answers_8(self, rig):
        rig.filter()
        rig.watchdog(60000)
        close(rig)
        assert set().union(*drives(rig).values()) == {8}

    def test_other_axes_are_not_held_by_it(self, rig):
        close(rig)
        rig.enter(POSITION, 1)

    def test_stays_until_clear_with_the_pin_high(self, rig):
        close(rig)
        rig.ok(0x06, axis=0)
        assert rig.inputs() & LIMIT_LATCHED
        close(rig, held="free")
        assert rig.inputs() & LIMIT_LATCHED
        rig.ok(0x06, axis=0)
        assert not rig.inputs() & LIMIT_LATCHED
        rig.enter(POSITION)

    def test_mode_0_stop_clear_reads_and_settings_are_never_refused(self, rig):
        close(rig)
        assert never_refused(rig) == {0}

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
        close(rig)
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
        close(rig)
        rig.ok(0x16, [0], 0)
        assert rig.settings().limit_enable == 1
        assert rig.inputs() & LIMIT_LATCHED

    def test_switches_of_the_mirrored_eye_go_by_counts(self, rig):
        rig.inject("place", axis="right_vergence", angle=radians(-40.5))
        assert rig.inputs(1) & (POSITIVE | NEGATIVE) == POSITIVE
        rig.inject("place", axis="right_vergence", angle=radians(40.5))
        assert rig.inputs(1) & (POSITIVE | NEGATIVE) == NEGATIVE


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
        assert set().union(*drives(rig).values()) == {8}
        assert never_refused(rig) == {0}

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
        close(rig)
        rig.ok(0x05)
        assert set().union(*drives(rig).values()) == {9}
        assert rig.status(0x16, [1], 2) == 9
        assert never_refused(rig) == {0}

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
            close(rig, axis=name)
            close(rig, axis=name, held="free")
        rig.ok(0x06, axis=1)
        assert [rig.inputs(axis) & LIMIT_LATCHED for axis in (0, 1)] == [LIMIT_LATCHED, 0]
        rig.ok(0x06)
        assert rig.inputs(0) & LIMIT_LATCHED == 0

    def test_moves_nothing_and_leaves_the_mode(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(5)
        rig.ok(0x06)
        assert rig.settings().mode == INTEGRAL


def latched(rig, axis=0):
    source, caught, position, time_us = struct.unpack("<BBiI", rig.ok(0x21, axis=axis))
    return source, caught, position, time_us


class TestLatch:
    # The left eye's edge stands at −15°; it is approached from −15.5°.
    EDGE = radians(-15.0) * EYE

    def approach(self, make_rig, source, start=-15.5, velocity=2, board=1, axis=0, name="left_vergence"):
        rig = make_rig(board, start_deg={name: start})
        rig.enter(INTEGRAL, axis)
        rig.ok(0x1D, [source], axis)
        rig.velocity(velocity, axis)
        rig.run(0.5)
        return rig

    def test_home_rising_catches_the_count_of_the_edge_and_its_time_and_disarms(self, make_rig):
        rig = self.approach(make_rig, source=1)
        expected = int(self.EDGE // 1) - int(radians(-15.5) * EYE // 1)
        source, caught, position, time_us = latched(rig)
        assert (source, caught, position) == (0, 1, expected)
        assert rig.events(0x46) == [(0x46, 0, time_us, expected, 0)]
        assert time_us % 2048 != 0

    def test_is_the_same_from_a_different_speed(self, make_rig):
        slow, fast = (latched(self.approach(make_rig, 1, velocity=v)) for v in (1, 7))
        assert slow[2] == fast[2]

    def test_home_falling_is_on_to_off(self, make_rig):
        rig = self.approach(make_rig, source=2, start=-14.5, velocity=-2)
        expected = int(self.EDGE // 1) - int(radians(-14.5) * EYE // 1)
        assert latched(rig)[:3] == (0, 1, expected)

    @pytest.mark.parametrize(("source", "start", "velocity"), [(2, -15.5, 2), (1, -14.5, -2)])
    def test_the_other_edge_is_not_caught(self, make_rig, source, start, velocity):
        rig = self.approach(make_rig, source=source, start=start, velocity=velocity)
        assert latched(rig) == (source, 0, 0, 0)
        assert rig.events(0x46) == []

    def test_the_mirrored_eye_rises_as_counts_fall(self, make_rig):
        rig = self.approach(make_rig, 1, start=-12.5, velocity=-2, axis=1, name="right_vergence")
        assert latched(rig, 1)[1] == 1
        assert latched(rig, 1)[2] < 0

    def test_an_index_comes_every_2000_counts(self, make_rig):
        rig = make_rig()
        rig.enter(INTEGRAL)
        rig.velocity(30)
        caught = []
        for _ in range(2):
            rig.ok(0x1D, [3], 0)
            rig.run(0.2)
            caught.append(latched(rig)[2])
        assert caught[1] - caught[0] == 2000

    def test_only_edges_after_arming_count(self, make_rig):
        rig = self.approach(make_rig, source=0)
        assert rig.inputs() & HOME
        rig.ok(0x1D, [1], 0)
        rig.run(0.1)
        assert latched(rig)[:2] == (1, 0)

    def test_what_was_caught_is_kept_until_the_next_latch(self, make_rig):
        rig = self.approach(make_rig, source=1)
        kept = latched(rig)
        rig.ok(0x16, [0], 0)
        assert latched(rig) == kept
        rig.ok(0x1D, [0], 0)
        assert latched(rig) == (0, 0, 0, 0)

    def test_going_idle_disarms(self, rig):
        rig.enter(POSITION)
        rig.ok(0x1D, [2], 0)
        rig.ok(0x16, [0], 0)
        assert latched(rig) == (0, 0, 0, 0)

    def test_an_unknown_source_answers_4(self, rig):
        assert {rig.status(0x1D, [source]) for source in (4, 0xFF)} == {4}

    def test_a_sensor_that_comes_unstuck_gives_an_edge_where_it_is(self, rig):
        rig.inject("sensor", axis="left_vergence", stuck="off")
        assert not rig.inputs() & HOME
        rig.ok(0x1D, [1], 0)
        rig.inject("sensor", axis="left_vergence", stuck="free")
        assert rig.inputs() & HOME
        assert latched(rig) == (0, 1, 0, round(rig.t * 1e6))

    def test_with_the_encoder_lost_it_catches_the_count_that_stands(self, rig):
        rig.enter(POSITION)
        rig.inject("encoder_loss", axis="left_vergence")
        rig.ok(0x1D, [2], 0)
        rig.inject("place", axis="left_vergence", angle=radians(-20))
        assert latched(rig)[:3] == (0, 1, 0)


class TestEncoderLoss:
    def test_the_chip_notices_nothing_and_runs_the_motor_to_full_output(self, rig):
        rig.enter(INTEGRAL)
        rig.velocity(20)
        rig.run(0.2)
        rig.inject("encoder_loss", axis="left_vergence")
        stood = rig.snapshot().actual
        rig.run(0.1)
        shown = rig.snapshot()
        assert (shown.actual, shown.motor, rig.settings().mode) == (stood, 0xFF, INTEGRAL)

    def test_the_counts_in_between_are_lost(self, rig):
        rig.inject("encoder_loss", axis="left_vergence")
        rig.inject("place", axis="left_vergence", angle=radians(10))
        assert rig.snapshot().actual == 0
        rig.inject("encoder_loss", axis="left_vergence", on=False)
        rig.inject("place", axis="left_vergence", angle=radians(11))
        # One degree is 322.6 counts; each end is floored.
        assert rig.snapshot().actual == pytest.approx(radians(1) * EYE, abs=1)

    def test_an_amplifiers_own_loss_is_a_feedback_error_and_its_boards_alone_is_none(self, rig):
        rig.inject("encoder_loss", axis="left_vergence", at="board")
        assert not rig.inputs() & FAULT
        rig.inject("encoder_loss", axis="left_vergence", at="amplifier")
        assert rig.inputs() & FAULT
