"""A base is at rest when what drove it returns, however often that was cancelled; by the emulator's truth.

The moments that were found wrong; the contract of a base cancels at random ones.
"""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from labmate.base import MobileBase
from labmate.simulation import SimulatedBase

RAMP = 0.3 / 0.25


def moving(sim: SimulatedBase) -> bool:
    true = sim.bench.state()["base"]
    return bool(true["speed"] != 0.0 or true["turn_rate"] != 0.0 or true["mode"] != "idle")


async def drive(base: MobileBase, seconds: float) -> None:
    async with base.motion() as motion:
        for _ in range(round(seconds / 0.1)):
            motion.twist(0.3, 0.0)
            await asyncio.sleep(0.1)


async def test_a_motion_that_ends_by_itself_and_is_cancelled_while_it_ramps_down_is_at_rest(
    sim: SimulatedBase, base: MobileBase
) -> None:
    task = asyncio.create_task(drive(base, 2.0))
    await asyncio.sleep(2.0 + RAMP / 2)
    assert moving(sim)
    task.cancel()
    await asyncio.wait((task,))
    assert task.cancelled()
    assert not moving(sim)


@pytest.mark.parametrize("run", [lambda base: base.go(3.0), lambda base: base.turn(3.0)], ids=["go", "turn"])
async def test_a_travel_that_is_cancelled_twice_is_at_rest(
    sim: SimulatedBase, base: MobileBase, run: Callable[[MobileBase], Awaitable[object]]
) -> None:
    task = asyncio.ensure_future(run(base))
    await asyncio.sleep(1.5)
    task.cancel()
    await asyncio.sleep(0.02)
    assert moving(sim)
    task.cancel()
    await asyncio.wait((task,))
    assert task.cancelled()
    assert not moving(sim)


@pytest.mark.parametrize("gap", [None, 0.0, 0.001, 0.1])
async def test_a_base_whose_context_is_cancelled_three_times_in_succession_is_at_rest(
    sim: SimulatedBase, gap: float | None
) -> None:
    async def program() -> None:
        async with sim.open() as base:
            await drive(base, 10.0)

    task = asyncio.create_task(program())
    await asyncio.sleep(2.0)
    assert moving(sim)
    for _ in range(3):
        task.cancel()
        if gap is not None:
            await asyncio.sleep(gap)
    await asyncio.wait((task,))
    assert task.cancelled()
    assert not moving(sim)


async def test_a_stop_that_is_cancelled_is_carried_through(sim: SimulatedBase, base: MobileBase) -> None:
    await base.twist(0.3, 0.0)
    await asyncio.sleep(0.25)
    task = asyncio.create_task(base.stop())
    await asyncio.sleep(0.01)
    assert moving(sim)
    task.cancel()
    await asyncio.wait((task,))
    assert task.cancelled()
    assert not moving(sim)
