"""The board's LATCH, and a lost encoder (docs/protocols, the board)."""

import struct
from math import radians

import pytest

WHOLE = 0x0F
IDLE, POSITION, PROPORTIONAL, INTEGRAL = range(4)
NEGATIVE, POSITIVE, HOME, FAULT, LIMIT_LATCHED, STOP_LATCHED, FAULT_LATCHED = (1 << n for n in range(7))
EYE = 18482.5


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
