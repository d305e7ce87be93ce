"""People about the base: they press its bumpers, moving or at rest, and hold nothing."""

from math import inf

import pytest

from sim_devices.labmate import BaseConfig, Box
from sim_devices.labmate.floor import Walker

BUMPER, DONE = 0x51, 0x50
FRONT, REAR, LEFT = 1, 2, 4


def walker(x0, y0, speed_x, speed_y=0.0, *, since=0.0):
    """A square of 0.4 m that walks straight on from its place at a time."""

    def outline(t):
        gone = max(0.0, t - since)
        return Box(x0 + speed_x * gone, y0 + speed_y * gone, 0.4, 0.4)

    return Walker(outline, abs(speed_x) + abs(speed_y))


def test_a_base_at_rest_reports_who_walks_into_it_when_he_touches(station):
    # The front is at 0.375, his side at 1.8: 1.425 m at 0.5 m/s.
    station.machine.let_walk([walker(2.0, 0.0, -0.5)])
    station.run(2.8)
    assert station.told() == []
    assert station.machine.touched_at is None
    assert station.machine.clearance(station.now) == pytest.approx(0.025)
    station.run(0.1)
    assert station.told() == [(BUMPER, FRONT)]
    # Contact is looked for in steps of 0.1 ms.
    assert station.machine.touched_at == pytest.approx(2.85, abs=2e-4)


def test_who_walks_past_is_not_felt(station):
    station.machine.let_walk([walker(-3.0, 0.6, 1.0)])  # 0.05 m beside the body
    station.drive(1000)
    station.run(3.3)
    assert station.told() == []
    assert station.machine.touched_at is None
    assert station.machine.clearance(station.now) == pytest.approx(0.05, abs=2e-3)  # it drives a slight bend


def test_a_bumper_that_somebody_pressed_stops_the_base_and_lets_go_when_he_is_gone(station):
    station.machine.let_walk([walker(0.3, 1.0, 0.0, -0.4, since=1.0)])
    station.go(20000)
    station.run(3.0)
    assert station.told() == [(BUMPER, LEFT), (DONE, 2)]
    assert station.body.true.x < 0.6
    station.run(20.0)
    assert not station.flags & 0b11110


def test_a_person_gives_way_to_the_frame(station):
    station.machine.let_walk([walker(0.6, 0.0, 0.0)])  # the front comes to 0.4 m after 25 mm
    station.go(10000)
    station.run(5.0)
    assert station.told() == [(BUMPER, FRONT), (DONE, 2)]
    station.machine.break_bumper("front")
    station.go(2000)
    station.run(3.0)
    assert station.told() == [(DONE, 0)]  # no stall: it is not held
    assert station.body.true.x > 0.2


def test_without_people_a_base_at_rest_asks_for_nothing(make_station):
    station = make_station(BaseConfig(walls=[(20.0, -1.0, 20.0, 1.0)]))
    assert station.body.next_time() == inf
    station.machine.let_walk([walker(5.0, 0.0, -0.1)])
    # 5 m less its half and the base's, at 0.1 m/s.
    assert station.body.next_time() == pytest.approx((5.0 - 0.2 - 0.375) / 0.1, rel=0.05)


def test_what_a_bumper_does_not_meet_is_a_touch_all_the_same(make_station):
    station = make_station(BaseConfig(boxes=[Box(1.0, 0.0, 0.2, 0.2, low=True)]))
    assert station.machine.clearance(0.0) == pytest.approx(1.0 - 0.1 - 0.375)
    station.go(10000)
    station.run(6.0)
    assert station.told() == [(0x53, 0), (DONE, 5)]
    assert station.machine.touched_at is not None
