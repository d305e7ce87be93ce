"""Whatever ends a motion keeps to the configured acceleration: judged by the plant's true angle."""

import asyncio
import math
from collections.abc import Awaitable, Callable

import numpy as np
import pytest

from medusa.head.joint_group import JointGroup
from medusa.mc3000.board import Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import SimulatedHead
from sim_devices.mc3000.reports import Recording

DEGREE = math.radians(1)
ACCELERATION = {"pan": 1080.0, "tilt": 540.0, "left_vergence": 1080.0}
"""Of the shipped configuration, °/s²."""
WINDOW_SECONDS = 0.02
"""One DAC count more or less for one sample is up to 239°/s² (C/T_M, thesis §1.2): the mean of ten samples."""
EXCESS = 1.1

End = Callable[[JointGroup, str], Awaitable[object]]


async def step(head: JointGroup, name: str) -> None:
    """What a microsaccade begins with; no step, which has no ramp by its nature."""
    await Mc3000Drive.of(head).axes[name].set_mode(Mode.POSITION)
    await head.step({name: (await head.read()).joints[name].commanded})


ENDS: dict[str, End] = {
    "move": lambda head, name: head.move({name: 15 * DEGREE}),
    "saccade": lambda head, name: head.move({name: -15 * DEGREE}, together=True),
    "step": step,
    "zero velocity": lambda head, name: head.velocity({name: 0.0}),
    "stop": lambda head, name: head.stop(),
    "disable": lambda head, name: head.disable(),
    "park": lambda head, name: head.park(),
    "position mode at once after zero": lambda head, name: zero_and_hold(head, name),
}


async def zero_and_hold(head: JointGroup, name: str) -> None:
    await head.velocity({name: 0.0})
    await Mc3000Drive.of(head).axes[name].set_mode(Mode.POSITION)


def peak_deceleration(recording: Recording) -> float:
    """Greatest mean deceleration of the true joint angle over 20 ms, °/s²."""
    time, angle = np.array(recording.time), np.degrees(np.array(recording.angle))
    speed = np.gradient(angle, time)
    step = max(1, round(WINDOW_SECONDS / (time[1] - time[0])))
    change = (speed[step:] - speed[:-step]) / (time[step:] - time[:-step])
    return float(np.max(-change * np.sign(speed[:-step])))


@pytest.mark.parametrize("end", ENDS)
@pytest.mark.parametrize(("name", "speed"), [("pan", 61.0), ("pan", -120.0), ("tilt", 61.0)])
async def test_whatever_ends_a_velocity_keeps_to_the_configured_acceleration(
    sim: SimulatedHead, head: JointGroup, name: str, speed: float, end: str
) -> None:
    await head.move({name: -math.copysign(20, speed) * DEGREE})
    with sim.machine.record(name) as recording:
        await head.velocity({name: speed * DEGREE})
        await asyncio.sleep(0.25)
        await ENDS[end](head, name)
        await asyncio.sleep(0.2)
    assert peak_deceleration(recording) <= EXCESS * ACCELERATION[name]


@pytest.mark.parametrize("end", ["stop", "disable", "cancel"])
async def test_whatever_ends_a_profile_keeps_to_the_configured_acceleration(
    sim: SimulatedHead, head: JointGroup, end: str
) -> None:
    with sim.machine.record("left_vergence") as recording:
        moving = asyncio.ensure_future(head.move({"left_vergence": 30 * DEGREE}))
        await asyncio.sleep(0.15)
        if end == "cancel":
            moving.cancel()
        else:
            await ENDS[end](head, "left_vergence")
        await asyncio.gather(moving, return_exceptions=True)
        await asyncio.sleep(0.2)
    assert peak_deceleration(recording) <= EXCESS * ACCELERATION["left_vergence"]
