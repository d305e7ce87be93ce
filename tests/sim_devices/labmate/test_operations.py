"""Every operation of the base's page: what it takes, answers and refuses."""

import json
import struct
from math import radians
from pathlib import Path

import pytest

from sim_devices.labmate.body import Pose
from sim_devices.labmate.operations import Mode
from sim_devices.link.frame import FrameReceiver, encode_frame

VECTORS = {
    vector["name"]: vector
    for vector in json.loads((Path(__file__).parents[2] / "vectors" / "labmate.json").read_text())
}
HELLO, CLEAR, EMERGENCY_STOP, WATCHDOG = 1, 6, 5, 4
POSE, SET_POSE, DRIVE, GO, TURN, STOP, LIMITS, STATUS, ENCODERS = range(0x30, 0x39)
SIZES = {POSE: 0, SET_POSE: 12, DRIVE: 6, GO: 4, TURN: 4, STOP: 0, LIMITS: 8, STATUS: 0, ENCODERS: 0}


def frames(station):
    return [data.hex() for _, data in station.frames]


class TestVectors:
    def test_hello_reply(self, station):
        station.device.boot_count = 1
        station.device.receive(encode_frame(0x10, 0, 1, HELLO, 15, b"\x34\x12"), 0.0)
        assert frames(station)[-1] == VECTORS["HELLO reply"]["frame"]

    def test_drive_is_taken(self, station):
        station.run(0.1)
        station.device.receive(
            bytes.fromhex(VECTORS["DRIVE 80 mm/s, -7.1 deg/s, 500 ms"]["frame"]), station.now
        )
        station.run(0.45)
        # 80 mm/s at 250 mm/s² takes 320 ms, 7.1 °/s at 30 °/s² 237 ms, and the drive 32 ms.
        assert station.pose()[4:] == (pytest.approx(800, abs=20), pytest.approx(-710, abs=2))
        station.run(0.06)
        assert station.mode == Mode.STOPPING

    def test_pose_reply(self, station):
        station.advance(5.0)
        station.body.odometry = Pose(1.5, -0.02, radians(45))
        station.body.forward.speed = station.body.forward.reference = 0.08
        station.device.receive(encode_frame(0x10, 0, 3, POSE, 15), 5.0)
        assert frames(station)[-1] == VECTORS["POSE reply"]["frame"]

    def test_turn_is_taken(self, station):
        station.device.receive(bytes.fromhex(VECTORS["TURN -90 deg"]["frame"]), 0.0)
        station.finish()
        assert station.pose()[3] == pytest.approx(-9000, abs=10)

    def test_status_reply_and_limits(self, station):
        station.device.receive(bytes.fromhex(VECTORS["LIMITS"]["frame"]), 0.0)
        assert station.replies[-1].axis == 0
        station.machine.drain_battery(24.6)
        station.drive(3000)
        station.run(0.01)
        station.device.receive(encode_frame(0x10, 0, 5, STATUS, 15), station.now)
        assert frames(station)[-1] == VECTORS["STATUS reply, driving, 24.6 V"]["frame"]

    def test_bumper_event_and_the_refusal_after_it(self, station):
        station.machine.base.emit(0x52, 0, bytes(17))
        station.advance(6.0)
        station.body.odometry = Pose(1.5, -0.02, radians(45))
        station.machine.press_bumper("front")
        assert VECTORS["event: front bumper"]["frame"] in frames(station)
        station.device.receive(encode_frame(0x10, 0, 7, TURN, 15, struct.pack("<i", 9000)), 6.0)
        assert frames(station)[-1] == VECTORS["TURN refused: front bumper pressed"]["frame"]

    def test_event_of_a_motion_that_a_bumper_stopped(self, station):
        station.machine.base.emit(0x52, 0, bytes(17))
        station.advance(6.5)
        station.body.odometry = Pose(1.501, -0.0201, radians(45))
        # The bumper is pressed in the instant in which the GO begins: bumper is event 1, motion done event 2.
        station.go(9000)
        station.machine.press_bumper("front")
        assert VECTORS["event: motion done, stopped by a bumper"]["frame"] in frames(station)


class TestRefusals:
    @pytest.mark.parametrize("operation", [0x2F, 0x39, 0x10, 0xFF])
    def test_an_unknown_operation_answers_1(self, station, operation):
        assert station.status_of(operation) == 1

    @pytest.mark.parametrize("operation", SIZES)
    @pytest.mark.parametrize("axis", [0, 1, 14])
    def test_any_axis_but_the_whole_device_answers_2(self, station, operation, axis):
        assert station.request(operation, bytes(9), axis).axis == 2

    @pytest.mark.parametrize("axis", [0, 1])
    def test_clear_takes_the_whole_device_only(self, station, axis):
        assert station.request(CLEAR, b"", axis).axis == 2
        assert station.request(CLEAR, b"too long", axis).axis == 2

    @pytest.mark.parametrize(("operation", "size"), SIZES.items())
    def test_a_bad_length_answers_3(self, station, operation, size):
        assert station.request(operation, bytes(size + 1)).axis == 3
        if size:
            assert station.request(operation, bytes(size - 1)).axis == 3

    def test_a_watchdog_action_other_than_0_answers_4(self, station):
        assert station.status_of(WATCHDOG, "<HB", 100, 1) == 4
        assert station.status_of(WATCHDOG, "<HB", 100, 0) == 0

    def test_set_pose_needs_mode_0(self, station):
        station.drive(100)
        assert station.status_of(SET_POSE, "<3i", 0, 0, 0) == 6

    def test_set_pose_needs_both_wheels_at_rest(self, station):
        station.drive(1000)
        station.run(1.0)
        station.machine.restart()
        station.request(HELLO, b"ab")
        assert station.mode == 0
        assert station.flags & 1
        assert station.status_of(SET_POSE, "<3i", 0, 0, 0) == 6
        station.run(1.0)
        assert station.status_of(SET_POSE, "<3i", 0, 0, 0) == 0

    def test_limits_need_mode_0(self, station):
        station.drive(0)
        assert station.limits(1000, 1000, 100, 100) == 6

    @pytest.mark.parametrize(
        "limits",
        [
            (0, 1500, 250, 300),
            (3000, 0, 250, 300),
            (3000, 1500, 0, 300),
            (3000, 1500, 250, 0),
            (10001, 1500, 250, 300),
            (3000, 32768, 250, 300),
        ],
    )
    def test_limits_of_zero_or_too_high_answer_4_and_change_nothing(self, station, limits):
        assert station.limits(*limits) == 4
        assert station.drive(3000, 1500) == 0
        assert station.drive(3001, 0) == 4

    def test_the_highest_limits_are_taken(self, station):
        assert station.limits(10000, 32767, 65535, 65535) == 0
        assert station.drive(-10000, 32767) == 0

    @pytest.mark.parametrize(
        ("speed", "turn_rate"), [(3001, 0), (-3001, 0), (0, 1501), (0, -1501), (-32768, -32768)]
    )
    def test_a_drive_over_the_limits_of_power_up_answers_4(self, station, speed, turn_rate):
        assert station.drive(speed, turn_rate) == 4
        assert station.mode == 0

    @pytest.mark.parametrize(("valid_ms", "status"), [(0, 4), (1, 0), (2000, 0), (2001, 4), (65535, 4)])
    def test_a_drive_is_valid_for_1_to_2000_ms(self, station, valid_ms, status):
        assert station.drive(100, 0, valid_ms) == status

    @pytest.mark.parametrize("begin", ["go", "turn"])
    def test_while_a_go_or_turn_runs_drive_go_and_turn_answer_11(self, station, begin):
        getattr(station, begin)(9000)
        assert (station.drive(100), station.go(100), station.turn(100)) == (11, 11, 11)

    def test_while_driving_and_stopping_go_and_turn_answer_11_and_drive_is_taken(self, station):
        station.drive(1000)
        station.run(0.5)
        assert (station.go(100), station.turn(100), station.drive(500)) == (11, 11, 0)
        station.stop()
        assert station.mode == Mode.STOPPING
        assert (station.go(100), station.turn(100), station.drive(500)) == (11, 11, 0)
        assert station.mode == Mode.DRIVE

    def test_while_the_emergency_stop_is_latched_every_motion_answers_9_and_settings_do_not(self, station):
        station.request(EMERGENCY_STOP)
        assert (station.drive(0), station.go(100), station.turn(100)) == (9, 9, 9)
        assert (station.stop(), station.limits(1000, 1000, 100, 100)) == (0, 0)
        assert station.status_of(SET_POSE, "<3i", 1, 2, 3) == 0
        station.request(CLEAR)
        assert station.go(100) == 0

    @pytest.mark.parametrize(
        ("side", "forward", "backward", "turning"),
        [("front", 8, 0, 8), ("rear", 0, 8, 8), ("left", 0, 0, 8), ("right", 0, 0, 8)],
    )
    def test_a_pressed_bumper_refuses_motion_toward_it(self, make_station, side, forward, backward, turning):
        def answers(begin):
            station = make_station()
            station.machine.press_bumper(side)
            return begin(station)

        assert answers(lambda s: s.drive(100)) == forward
        assert answers(lambda s: s.go(100)) == forward
        assert answers(lambda s: s.drive(-100)) == backward
        assert answers(lambda s: s.go(-100)) == backward
        assert answers(lambda s: s.drive(0, 100)) == turning
        assert answers(lambda s: s.drive(0, -100)) == turning
        assert answers(lambda s: s.turn(100)) == turning
        assert answers(lambda s: s.drive(0, 0)) == 0

    def test_a_stall_refuses_every_motion_until_cleared(self, station):
        station.machine.hold_wheels()
        station.drive(1000)
        station.run(1.0)
        station.machine.hold_wheels(held=False)
        assert (station.drive(-100), station.go(-100), station.turn(100)) == (8, 8, 8)
        station.request(CLEAR)
        assert station.drive(-100) == 0

    def test_a_low_battery_refuses_a_new_go_only(self, station):
        station.machine.drain_battery(21.9)
        assert station.go(1000) == 6
        assert station.turn(100) == 0
        assert station.go(1000) == 11
        station.stop()
        station.finish()
        assert station.drive(100) == 0

    def test_of_several_reasons_the_first_of_the_page_is_answered(self, station):
        station.drive(1000)
        station.run(0.2)
        station.go(1000)
        station.machine.press_bumper("front")
        # 8 goes before 11 (stopping) and before 4 (over the limit).
        assert station.go(1000) == 8
        assert station.drive(9999) == 8
        station.request(EMERGENCY_STOP)
        # 9 goes before 8, 3 before 9, 2 before 3.
        assert station.go(1000) == 9
        assert station.request(GO, b"x").axis == 3
        assert station.request(GO, b"x", 1).axis == 2

    def test_mode_busy_goes_before_range(self, station):
        station.go(10000)
        assert station.drive(9999) == 11

    def test_a_refused_motion_moves_nothing(self, station):
        station.drive(3001)
        station.run(5.0)
        assert station.encoders()[1:] == (0, 0)


class TestAnswers:
    def test_encoders_count_50000_a_metre_of_nominal_way(self, station):
        station.go(10000)
        station.finish()
        _, left, right = station.encoders()
        # A wheel is called at rest at 1 mm/s: the last 1 mm/s × 32 ms = 0.03 mm = 1.6 counts are not gone.
        assert left == right
        assert left == pytest.approx(50000, abs=2)

    def test_encoders_of_a_turn_follow_the_nominal_wheel_base(self, station):
        station.turn(9000)
        station.finish()
        _, left, right = station.encoders()
        # 340 mm · π/2 / 2 = 267.04 mm = 13352 counts either way, less 1.6.
        assert right == pytest.approx(13352, abs=3)
        assert left == -right

    def test_set_pose_moves_the_pose_and_leaves_the_encoders(self, station):
        station.go(1000)
        station.finish()
        before = station.encoders()[1:]
        assert station.status_of(SET_POSE, "<3i", -50000, 70000, 123456) == 0
        assert station.pose()[1:4] == (-50000, 70000, 123456)
        assert station.encoders()[1:] == before

    def test_the_heading_is_continuous(self, station):
        for _ in range(3):
            station.turn(18000)
            station.finish()
        assert station.pose()[3] == pytest.approx(54000, abs=10)

    def test_pose_and_encoders_carry_the_time_since_power_up(self, station):
        station.advance(12.5)
        assert station.pose()[0] == station.encoders()[0] == 12_500_000

    def test_speed_and_turn_rate_are_those_of_now(self, station):
        station.drive(2000, 1000)
        station.run(1.9)
        assert station.pose()[4:] == (2000, 1000)

    def test_limits_act_on_the_next_motion(self, station):
        station.limits(1000, 1500, 100, 300)
        station.go(10000)
        station.run(2.0)
        # 100 mm/s at 100 mm/s² is reached after one second.
        assert station.pose()[4] == pytest.approx(1000, abs=1)

    def test_restart_loses_pose_counts_limits_and_latches(self, station):
        station.limits(1000, 1000, 100, 100)
        station.go(1000)
        station.finish()
        station.request(EMERGENCY_STOP)
        station.machine.restart()
        assert station.status_of(POSE) == 10
        station.request(HELLO, b"ab")
        assert station.pose()[1:4] == (0, 0, 0)
        assert station.encoders()[1:] == (0, 0)
        assert station.flags == 0x40
        assert station.drive(3000, 1500) == 0

    def test_every_reply_is_a_frame_of_the_link(self, station):
        for operation in (POSE, STATUS, ENCODERS):
            station.request(operation)
        for _, data in station.frames:
            assert isinstance(next(iter(FrameReceiver().feed(data))), tuple)
