"""What the wheels really do against what the base believes, beside closed forms."""

from cmath import exp
from math import acos, degrees, hypot, pi, radians, sin

import pytest

from sim_devices.labmate import BaseConfig, Bump
from sim_devices.labmate.body import Pose
from sim_devices.labmate.wheels import WHEEL_RADIUS

TRUE_BASE, RATIO = 0.3372, 1.00121
LEFT, RIGHT = 2 / (1 + RATIO), 2 * RATIO / (1 + RATIO)
EXACT = BaseConfig(wheel_base=0.340, diameter_ratio=1.0)


def drive_square(station, side):
    """Drive the 4 m square by the base's own odometry, ending with the fourth turn."""
    for _ in range(4):
        station.go(40000)
        station.finish()
        station.turn(side * 9000)
        station.finish()
    station.run(0.5)


def closed_form_square(side):
    """Return (position, heading) of the true way: arcs of 4 m, and turns about a point beside the middle."""
    position, heading = 0j, 0.0
    for _ in range(4):
        for left, right in ((4.0, 4.0), (-side * pi / 4 * 0.34, side * pi / 4 * 0.34)):
            way = (left * LEFT + right * RIGHT) / 2
            turn = (right * RIGHT - left * LEFT) / TRUE_BASE
            # The chord of an arc.
            position += way * sin(turn / 2) / (turn / 2) * exp(1j * (heading + turn / 2))
            heading += turn
    return position, heading


@pytest.mark.parametrize(("side", "closing"), [(1, 0.306), (-1, 0.015)])
def test_the_uncalibrated_square_closes_as_published(station, side, closing):
    drive_square(station, side)
    true, believed = station.body.true, station.body.odometry
    error = hypot(true.x - believed.x, true.y - believed.y)
    assert error == pytest.approx(closing, abs=0.003)
    position, heading = closed_form_square(side)
    # Each of eight motions ends 0.03 mm or 0.011° early, and the believed square does not close by as much.
    assert abs(position) == pytest.approx(error, abs=0.003)
    assert true.heading == pytest.approx(heading, abs=radians(0.1))


def test_with_the_nominal_geometry_truth_and_belief_agree(make_station):
    station = make_station(EXACT)
    drive_square(station, 1)
    assert station.body.true == pytest.approx(station.body.odometry, abs=1e-9)


def test_a_straight_way_bends_to_the_smaller_wheel(station):
    station.go(40000)
    station.finish()
    # The right wheel is the larger: the base bears left by 4 m (RIGHT − LEFT)/b.
    assert station.body.true.heading == pytest.approx(4 * (RIGHT - LEFT) / TRUE_BASE, rel=1e-4)
    assert station.pose()[3] == 0


def test_a_turn_goes_further_than_believed_by_the_ratio_of_the_wheel_bases(station):
    station.turn(36000)
    station.finish()
    assert station.body.true.heading / station.body.odometry.heading == pytest.approx(
        0.340 / TRUE_BASE, rel=1e-9
    )


def test_the_true_pose_starts_where_the_floor_plan_says(make_station):
    station = make_station(BaseConfig(start_x=2.0, start_y=-1.0, start_heading_deg=90.0))
    assert station.machine.pose(0.0) == Pose(2.0, -1.0, pi / 2)
    assert station.pose()[1:4] == (0, 0, 0)
    station.go(10000)
    station.finish()
    assert station.machine.pose(station.now).y == pytest.approx(0.0, abs=1e-3)


@pytest.mark.parametrize(("wheel", "sign"), [("left", 1), ("right", -1)])
def test_a_10_mm_bump_under_one_wheel_turns_the_heading_0_6_degrees(make_station, wheel, sign):
    station = make_station(BaseConfig(wheel_base=0.340, diameter_ratio=1.0, bumps=[Bump(wheel, 1.0)]))
    station.go(20000)
    station.finish()
    angle = acos(1 - 0.010 / WHEEL_RADIUS)
    lost = 2 * WHEEL_RADIUS * (angle - sin(angle))
    assert degrees(station.body.true.heading) == pytest.approx(sign * 0.6, abs=0.1)
    assert station.body.true.heading == pytest.approx(sign * lost / 0.340, rel=1e-3)
    # The base itself notices nothing.
    assert station.pose()[3] == 0


def test_a_bump_laid_before_a_wheel_acts_once_and_backward_too(make_station):
    station = make_station(EXACT)
    station.go(-10000)
    station.run(2.0)
    station.machine.bump("right", 0.010)
    station.finish()
    # Backward the right wheel lags: its side falls behind, the heading turns left.
    assert degrees(station.body.true.heading) == pytest.approx(0.6, abs=0.1)
    station.go(-10000)
    station.finish()
    assert degrees(station.body.true.heading) == pytest.approx(0.6, abs=0.1)


def test_a_wheel_that_spins_on_the_spot_turns_the_base_about_itself(make_station):
    station = make_station(EXACT)
    station.machine.slip("left", 0.05)
    station.go(10000)
    station.finish()
    # Within the roundings of the first 10 ms step at the slip's edges.
    assert station.body.true.heading == pytest.approx(0.05 / 0.340, rel=1e-3)
    assert station.encoders()[1] == station.encoders()[2]


def test_slip_as_a_part_of_the_way_shortens_it(make_station):
    station = make_station(BaseConfig(wheel_base=0.340, diameter_ratio=1.0, slip_left=0.01, slip_right=0.01))
    station.go(10000)
    station.finish()
    assert station.body.true.x == pytest.approx(0.99, abs=1e-4)


@pytest.mark.parametrize(
    ("verb", "arguments", "said"),
    [
        ("bump", {"wheel": "third"}, "wheel is 'third', must be left or right"),
        ("bump", {"wheel": "left", "height": 0.2}, "height is 0.2, must be above 0 and below 0.07 m"),
        ("slip", {"wheel": "left", "distance": -1}, "distance is -1, must be above 0 and below 10 m"),
        ("press_bumper", {"side": "top"}, "side is 'top', must be one of front, rear, left, right"),
        ("drain_battery", {"volts": 100}, "volts is 100, must be from 0 to 65"),
        ("place_box", {"x": 5, "y": 5, "length": 0, "width": 1}, "length is 0, must be above 0 m"),
    ],
)
def test_an_incident_that_cannot_be_is_refused(station, verb, arguments, said):
    with pytest.raises(ValueError, match=said):
        station.machine.verbs[verb](**arguments)


def test_any_way_of_asking_gives_the_same_motion(make_station):
    def trace(step):
        station = make_station()
        station.drive(2000, 1000)
        while station.now < 1.9 - 1e-9:
            station.run(step)
        return station.body.true

    # Arcs of 10 ms against arcs of 1 ms while speed and turn rate ramp: a tenth of a millimetre.
    assert trace(1.9) == pytest.approx(trace(0.001), abs=1e-4)
