"""Modes, profiles, stops, events and flags of the base, in time."""

import struct
from math import hypot, log, pi, radians, sin

import pytest

from sim_devices.labmate import BaseConfig, Box
from sim_devices.labmate.operations import Flag, Mode

HELLO, WATCHDOG, EMERGENCY_STOP, CLEAR, EVENT_MASK = 1, 4, 5, 6, 7
DONE, BUMPER, BATTERY_LOW, STALLED = 0x50, 0x51, 0x52, 0x53
E_STOP, WATCHDOG_EVENT = 0x43, 0x44
POLE_S = 1 / (2 * pi * 5)
WALL_AHEAD = BaseConfig(walls=[(1.0, -5.0, 1.0, 5.0)], diameter_ratio=1.0)


class TestGoAndTurn:
    @pytest.mark.parametrize("distance", [40000, 10000, -20000, 500, 20, 1, -1])
    def test_a_go_ends_within_2_mm_by_the_bases_own_odometry(self, station, distance):
        station.go(distance)
        station.finish()
        assert station.pose()[1] == pytest.approx(distance, abs=20)
        assert station.told() == [(DONE, 0)]

    @pytest.mark.parametrize("angle", [9000, -9000, 36000, 100, 1, -1])
    def test_a_turn_ends_within_a_tenth_of_a_degree(self, station, angle):
        station.turn(angle)
        station.finish()
        assert station.pose()[3] == pytest.approx(angle, abs=10)
        assert station.told() == [(DONE, 0)]

    def test_a_go_takes_the_time_of_its_trapezoid_and_of_the_drive(self, station):
        station.go(40000)
        station.finish()
        # 4 m at 0.3 m/s with 0.25 m/s²: 4/0.3 + 0.3/0.25 s; then the speed that is left, a τ = 8 mm/s after a
        # ramp of many τ, falls to 1 mm/s by the pole.
        ramp = 4 / 0.3 + 0.3 / 0.25
        assert station.events[0][2][0] / 1e6 == pytest.approx(
            ramp + POLE_S * log(0.25 * POLE_S / 0.001), abs=1e-5
        )

    def test_speed_and_acceleration_stay_within_the_limits(self, station):
        station.go(30000)
        last, speeds = 0, []
        for _ in range(1300):
            station.run(0.01)
            speed = station.pose()[4]
            # The wire rounds to 0.1 mm/s: two roundings against 2.5 mm/s in 10 ms.
            assert abs(speed - last) <= 25 + 1
            last = speed
            speeds.append(speed)
        assert max(speeds) == 3000
        assert min(speeds) == 0

    def test_a_turn_rate_of_7_1_degrees_is_held_within_1_percent(self, station):
        station.drive(0, 710)
        station.run(1.0)
        before = station.pose()[3]
        station.run(0.9)
        assert (station.pose()[3] - before) / 0.9 == pytest.approx(710, rel=0.01)

    def test_a_go_of_no_length_is_done_after_its_answer(self, station):
        assert station.go(0) == 0
        assert station.told() == []
        station.run(0.01)
        assert station.told() == [(DONE, 0)]
        assert station.mode == 0

    def test_mode_and_event_come_together_at_rest(self, station):
        station.go(1000)
        assert station.mode == Mode.GO
        while not station.events:
            station.run(0.001)
        assert station.status()[:2] == (0, Flag.MOTOR_POWER)
        sent, _, (time_us, *_) = station.events[0]
        assert sent == pytest.approx(time_us / 1e6, abs=1e-6)

    def test_a_turn_has_its_own_mode(self, station):
        station.turn(1000)
        assert station.mode == Mode.TURN


class TestDrive:
    def test_ramps_by_the_acceleration_and_lags_by_the_pole(self, station):
        station.drive(3000)
        station.run(0.8)
        # A first-order drive follows a ramp a·t by a·(t − τ) when e^(−t/τ) has died out.
        assert station.pose()[4] == pytest.approx(2500 * (0.8 - POLE_S), abs=1)

    def test_without_a_new_one_in_its_time_it_ramps_to_a_stop(self, station):
        station.drive(2000, 0, 1000)
        station.run(0.999)
        assert station.mode == Mode.DRIVE
        station.run(0.002)
        assert station.mode == Mode.STOPPING
        station.run(2000 / 2500 + 0.2)
        assert station.status()[:2] == (0, Flag.MOTOR_POWER)
        assert station.told() == []

    def test_a_new_one_in_time_goes_on_without_a_gap(self, station):
        for _ in range(20):
            station.drive(2000, 0, 300)
            station.run(0.29)
        assert station.pose()[4] == 2000
        assert station.mode == Mode.DRIVE

    def test_at_rest_it_ends_in_mode_0_at_once_when_its_time_is_over(self, station):
        station.drive(0, 0, 100)
        station.run(0.05)
        assert station.mode == Mode.DRIVE
        station.run(0.06)
        assert station.mode == Mode.IDLE

    def test_an_arc_is_reckoned_in_closed_form(self, station):
        station.drive(1000, 1000)
        station.run(1.5)
        _, x0, y0, heading0, *_ = station.pose()
        station.drive(1000, 1000)
        station.run(1.5)
        _, x1, y1, heading1, *_ = station.pose()
        turn = radians((heading1 - heading0) / 100)
        assert turn == pytest.approx(radians(15), abs=2e-4)
        # Chord of an arc of 0.15 m; 0.1 mm of wire rounding at each end.
        assert hypot(x1 - x0, y1 - y0) == pytest.approx(1500 * sin(turn / 2) / (turn / 2), abs=2)


class TestStop:
    def test_a_go_that_is_stopped_ramps_down_and_says_so(self, station):
        station.go(40000)
        station.run(3.0)
        station.stop()
        assert station.mode == Mode.STOPPING
        x = station.pose()[1]
        station.finish()
        assert station.told() == [(DONE, 1)]
        # v²/2a + v τ = 180 + 9.5 mm.
        assert station.pose()[1] - x == pytest.approx(1800 + 3000 * POLE_S, abs=5)

    def test_a_stop_is_accepted_in_every_mode_and_while_latched(self, station):
        assert station.stop() == 0
        assert station.mode == 0
        station.drive(0)
        assert (station.stop(), station.mode) == (0, 0)
        station.go(1000)
        station.run(0.2)
        assert (station.stop(), station.stop()) == (0, 0)
        station.request(EMERGENCY_STOP)
        assert station.stop() == 0
        station.finish()
        assert [detail for operation, detail in station.told() if operation == DONE] == [1]

    def test_a_drive_after_the_stop_of_a_go_tells_of_the_go_at_once(self, station):
        station.go(40000)
        station.run(2.0)
        station.stop()
        station.run(0.1)
        assert station.told() == []
        station.drive(1000)
        assert station.told() == [(DONE, 1)]
        station.run(5.0)
        assert station.told() == []

    def test_stopping_at_rest_ends_the_go_in_the_same_instant(self, station):
        station.go(1000)
        station.stop()
        assert station.told() == [(DONE, 1)]
        assert station.mode == 0


class TestEmergencyStop:
    @pytest.mark.parametrize("speed", [1000, 3000])
    def test_stops_at_once_and_runs_on_by_32_ms(self, station, speed):
        station.drive(speed)
        station.run(1.9)
        x = station.pose()[1]
        station.request(EMERGENCY_STOP)
        station.finish()
        assert station.pose()[1] - x == pytest.approx(speed * 0.0318, abs=1.5)
        assert station.told() == [(E_STOP, 0)]
        assert station.flags == Flag.EMERGENCY_STOP

    def test_ends_a_turn_with_detail_3(self, station):
        station.turn(9000)
        station.run(1.0)
        station.request(EMERGENCY_STOP)
        station.finish()
        assert station.told() == [(E_STOP, 0), (DONE, 3)]

    def test_a_latched_one_is_not_told_twice_and_clear_moves_nothing(self, station):
        station.go(20000)
        station.run(1.0)
        station.request(EMERGENCY_STOP)
        station.request(EMERGENCY_STOP)
        station.request(CLEAR)
        station.finish()
        assert station.told() == [(E_STOP, 0), (DONE, 3)]
        x = station.pose()[1]
        station.run(10.0)
        assert station.pose()[1] == x

    def test_the_button_stays_latched_while_it_is_held(self, station):
        station.machine.press_emergency_stop()
        station.request(CLEAR)
        assert station.go(100) == 9
        station.machine.release_emergency_stop()
        assert station.go(100) == 9
        station.request(CLEAR)
        assert station.go(100) == 0


class TestWatchdog:
    def test_ramps_to_a_stop_and_ends_a_go_with_detail_4(self, station):
        station.request(WATCHDOG, struct.pack("<HB", 200, 0))
        station.go(40000)
        station.run(0.21)
        assert station.told() == [(WATCHDOG_EVENT, 0)]
        # The event's acknowledgement feeds the watchdog, so that it expires and tells once more.
        station.run(3.0)
        assert [told for told in station.told() if told[0] == DONE] == [(DONE, 4)]
        assert station.mode == 0

    def test_what_it_stopped_does_not_resume(self, station):
        station.request(WATCHDOG, struct.pack("<HB", 200, 0))
        station.drive(1000, 0, 2000)
        station.run(1.5)
        x = station.pose()[1]
        station.run(5.0)
        assert station.pose()[1] == x


class TestHello:
    def test_ramps_to_a_stop_and_the_go_is_not_told_of(self, station):
        station.go(40000)
        station.run(2.0)
        station.request(HELLO, b"cd")
        station.request(EVENT_MASK, b"\xff\xff\xff\xff")
        assert station.mode == Mode.STOPPING
        station.run(3.0)
        assert station.mode == 0
        assert station.told() == []

    def test_leaves_pose_limits_and_latched_stops(self, station):
        station.limits(1000, 1000, 100, 100)
        station.go(1000)
        station.finish()
        pose = station.pose()[1:4]
        station.request(EMERGENCY_STOP)
        station.request(HELLO, b"cd")
        assert station.pose()[1:4] == pose
        assert station.drive(0) == 9
        station.request(CLEAR)
        assert station.drive(1001) == 4


class TestBumpers:
    def test_the_base_stops_at_the_wall_and_says_which_bumper_and_why(self, make_station):
        station = make_station(WALL_AHEAD)
        station.go(20000)
        station.finish()
        assert [(op, fields[-1]) for _, op, fields in station.events] == [(BUMPER, 1), (DONE, 2)]
        # The bumper touches when the middle is 1.0 − 0.375 m on; run-on 0.3 m/s × 31.8 ms = 9.5 mm.
        assert station.events[0][2][1] == pytest.approx(6250, abs=2)
        assert station.pose()[1] == pytest.approx(6250 + 95, abs=3)
        assert station.flags == Flag.MOTOR_POWER | Flag.FRONT

    def test_the_event_comes_within_5_ms_of_the_touch(self, make_station):
        station = make_station(WALL_AHEAD)
        station.go(20000)
        station.finish()
        sent, _, (time_us, *_) = station.events[0]
        # Trapezoid: 0.18 m of ramp take 1.2 s, the rest to 0.625 m at 0.3 m/s, all of it later by the pole.
        touch = 1.2 + (0.625 - 0.18) / 0.3 + POLE_S
        assert time_us / 1e6 == pytest.approx(touch, abs=2e-3)
        assert 0 <= sent - time_us / 1e6 <= 0.005

    def test_at_high_speed_the_base_goes_up_to_the_obstacle_and_not_into_it(self, make_station):
        station = make_station(BaseConfig(walls=[(3.0, -5.0, 3.0, 5.0)], diameter_ratio=1.0))
        station.limits(10000, 1500, 1000, 300)
        station.go(50000)
        station.finish()
        # 1 m/s × 31.8 ms = 32 mm are more than the 15 mm that the bumper gives way.
        assert station.machine.pose(station.now).x == pytest.approx(3.0 - 0.375 + 0.015, abs=2e-4)

    def test_the_flag_follows_the_contact_and_does_not_latch(self, make_station):
        station = make_station(WALL_AHEAD)
        station.go(20000)
        station.finish()
        assert station.go(20000) == 8
        assert station.go(-1000) == 0
        station.finish()
        assert station.flags == Flag.MOTOR_POWER
        assert station.go(500) == 0

    @pytest.mark.parametrize(
        ("box", "begin", "distance", "detail", "flag"),
        [
            (Box(0.6, 0.0, 0.2, 0.2), "go", 10000, 1, Flag.FRONT),
            (Box(-0.6, 0.0, 0.2, 0.2), "go", -10000, 2, Flag.REAR),
            # A post 10 mm beside the middle of a side: turning brings the side against it.
            (Box(0.0, 0.365, 0.1, 0.01), "turn", 9000, 4, Flag.LEFT),
            (Box(0.0, -0.365, 0.1, 0.01), "turn", -9000, 8, Flag.RIGHT),
        ],
    )
    def test_each_side_has_its_own(self, make_station, box, begin, distance, detail, flag):
        station = make_station(BaseConfig(boxes=[box]))
        getattr(station, begin)(distance)
        station.finish()
        assert station.told() == [(BUMPER, detail), (DONE, 2)]
        assert station.flags == Flag.MOTOR_POWER | flag

    def test_a_bumper_pressed_while_moving_away_stops_the_base_too(self, station):
        station.go(-10000)
        station.run(2.0)
        station.machine.press_bumper("front")
        station.finish()
        assert station.told() == [(BUMPER, 1), (DONE, 2)]

    def test_a_bumper_pressed_at_rest_is_told_once(self, station):
        station.machine.press_bumper("left")
        assert station.told() == [(BUMPER, 4)]
        station.machine.press_bumper("left")
        assert station.told() == []
        station.machine.release_bumper("left")
        assert station.flags == Flag.MOTOR_POWER

    def test_driving_goes_on_after_backing_off_only_by_a_new_command(self, make_station):
        station = make_station(WALL_AHEAD)
        station.drive(3000, 0, 2000)
        station.run(1.9)
        station.drive(3000, 0, 2000)
        station.run(1.9)
        assert station.told() == [(BUMPER, 1)]
        assert station.mode == 0
        station.machine.clear_floor()
        station.run(2.0)
        assert station.flags == Flag.MOTOR_POWER

    def test_an_obstacle_that_is_set_down_is_met(self, station):
        station.go(30000)
        station.run(1.0)
        station.machine.place_box(1.5, 0.0, 0.2, 0.2)
        station.finish()
        assert station.told() == [(BUMPER, 1), (DONE, 2)]
        assert station.machine.pose(station.now).x < 1.5 - 0.1 - 0.375 + 0.015

    def test_nothing_is_set_down_into_the_base(self, station):
        with pytest.raises(ValueError, match="the base stands there"):
            station.machine.place_box(0.1, 0.0, 0.2, 0.2)


class TestStall:
    def test_against_what_no_bumper_feels_the_base_stalls(self, make_station):
        station = make_station(BaseConfig(boxes=[Box(1.1, 0.0, 0.2, 0.2, low=True)], diameter_ratio=1.0))
        station.go(20000)
        station.finish()
        assert station.told() == [(STALLED, 0), (DONE, 5)]
        assert station.flags == Flag.MOTOR_POWER | Flag.STALLED
        # The frame is 15 mm behind the bumper's face.
        assert station.machine.pose(station.now).x == pytest.approx(1.0 - 0.375 + 0.015, abs=2e-4)

    def test_pushing_draws_current_and_moves_neither_base_nor_encoders(self, make_station):
        station = make_station(BaseConfig(boxes=[Box(1.1, 0, 0.2, 0.2, low=True)]))
        station.go(20000)
        while station.machine.state()["current"] < 20:
            station.run(0.001)
        pose, counts = station.machine.pose(station.now), station.encoders()[1:]
        station.run(0.2)
        assert station.machine.pose(station.now) == pose
        assert station.encoders()[1:] == counts

    def test_held_wheels_stall_after_300_ms_and_clear_releases(self, station):
        station.drive(1000, 0, 2000)
        station.run(1.0)
        station.machine.hold_wheels()
        station.run(0.29)
        assert station.told() == []
        station.run(0.02)
        assert station.told() == [(STALLED, 0)]
        assert station.mode == 0
        station.machine.hold_wheels(held=False)
        station.request(CLEAR)
        assert station.flags == Flag.MOTOR_POWER
        assert station.drive(1000) == 0

    def test_a_broken_bumper_ends_in_a_stall(self, make_station):
        station = make_station(WALL_AHEAD)
        station.machine.break_bumper("front")
        station.go(20000)
        station.finish()
        assert station.told() == [(STALLED, 0), (DONE, 5)]


class TestBattery:
    def test_moving_drains_it_faster_than_standing(self, make_station):
        def drop(moving):
            station = make_station(BaseConfig(battery_volts_per_ampere_hour=1.0))
            for _ in range(20):
                if moving:
                    station.drive(1000)
                station.run(1.0)
            return 24.0 - station.machine.state()["battery_volts"]

        # 20 s at 1 A and at 5 A, 1 V an ampere-hour.
        assert drop(False) == pytest.approx(20 / 3600, rel=1e-6)
        # A DRIVE of two seconds every second keeps it moving from its first instant on.
        assert drop(True) == pytest.approx(5 * 20 / 3600, rel=0.01)

    def test_low_is_told_once_at_its_time_and_flagged(self, make_station):
        station = make_station(BaseConfig(battery=22.001, battery_volts_per_ampere_hour=1.0))
        station.run(3.5)
        assert station.told() == []
        station.run(0.2)
        # 1 mV at 1 V/Ah and 1 A: 3.6 s.
        ((_, operation, (time_us, *_)),) = station.events
        assert (operation, time_us) == (BATTERY_LOW, pytest.approx(3.6e6, abs=2e3))
        station.run(100.0)
        assert len(station.events) == 1
        assert station.flags == Flag.MOTOR_POWER | Flag.BATTERY_LOW

    def test_it_does_not_stop_what_runs(self, station):
        station.go(10000)
        station.run(1.0)
        station.machine.drain_battery(21.0)
        station.finish()
        assert station.told() == [(BATTERY_LOW, 0), (DONE, 0)]


class TestFlags:
    def test_moving_is_set_while_a_wheel_turns(self, station):
        assert station.flags == Flag.MOTOR_POWER
        station.go(1000)
        station.run(0.1)
        assert station.flags == Flag.MOTOR_POWER | Flag.MOVING
        station.finish()
        assert station.flags == Flag.MOTOR_POWER

    def test_events_carry_time_and_pose_of_their_instant_and_axis_0(self, station):
        station.go(5000)
        station.finish()
        _, _, (time_us, x, y, heading, detail) = station.events[0]
        assert (x, y, heading, detail) == (*station.pose()[1:4], 0)
        assert time_us <= station.pose()[0]

    def test_a_masked_event_is_never_made(self, station):
        station.request(EVENT_MASK, bytes(4))
        station.machine.press_bumper("front")
        station.run(2.0)
        station.request(EVENT_MASK, b"\xff\xff\xff\xff")
        station.run(2.0)
        assert station.told() == []


def test_in_motion_the_base_asks_to_be_woken_only_when_something_can_happen(station):
    station.go(40000)
    station.finish()
    assert len(station.wakes) < 20
    assert station.device.next_due() > station.now + 3600
