"""A joint with its motor, as the tests of both build it."""

import pytest

from sim_devices.joint import Joint, JointGeometry
from sim_devices.motor import Bridge, Motor, MotorConstants

STOP, SWITCH, EDGE = 14516.0, 12903.0, -4839.0
EYE = {
    "time_constant": 16.020856e-3,
    "gain": 1235.08619,
    "counts_per_radian": 18482.5,
    "amplifier_gain": 1.0,
}


def make_joint(
    position=0.0,
    *,
    friction=0.0,
    backlash=0.0,
    bus=48.0,
    peak=20.0,
    continuous=10.0,
    constants=EYE,
    sign=1,
    edge=EDGE,
):
    motor = Motor(MotorConstants(**constants, friction_counts=friction), bus, peak, continuous)
    geometry = JointGeometry(STOP, SWITCH, edge, sign, backlash / 2)
    joint = Joint(motor, geometry, position, foldback_s=2.0)
    bridge(joint, Bridge.ENABLED)
    return joint


def bridge(joint, state):
    joint.motor.bridge = state
    joint.refresh()


@pytest.fixture(name="make_joint", scope="session")
def fixture_make_joint():
    return make_joint


@pytest.fixture(name="bridge", scope="session")
def fixture_bridge():
    return bridge
