"""Connecting to a head that is not quite as expected: what is refused, what is only logged."""

import asyncio
import struct

import pytest

from medusa.errors import NoReply, ProtocolError
from medusa.head.faults import Cause
from medusa.machines import open_head
from medusa.mc3000.drive import Mc3000Drive
from medusa.servo_amp import AmplifierLine
from medusa.simulation import SimulatedHead


async def test_chips_with_another_clock_are_refused(
    sim: SimulatedHead, monkeypatch: pytest.MonkeyPatch
) -> None:
    # A board of half the clock: every speed of the configuration would be half of what was checked.
    monkeypatch.setattr(sim.machine.boards[2], "hello_part", lambda: struct.pack("<BI", 3, 1_000_000))
    with pytest.raises(ProtocolError, match="board 02H: its chips run at 1000000 Hz, not at 2000000 Hz"):
        async with sim.open():
            pass


async def test_a_head_whose_amplifiers_do_not_answer_is_read_and_stopped_but_not_taken_as_homed(
    sim: SimulatedHead,
) -> None:
    async with sim.open() as head:
        await head.home(["pan"])
    sim.bench.inject("wire.stall", line="servo-amps", seconds=60.0)
    async with sim.open() as head:
        assert not Mc3000Drive.of(head).axes["pan"].homed
        await head.read()
        await head.stop()
        with pytest.raises(NoReply):
            await head.enable(["pan"])
    sim.bench.inject("wire.hang_up", line="servo-amps", seconds=0.1)
    async with open_head(sim.config, sim.boards, False, port_name="simulated") as head:
        assert not Mc3000Drive.of(head).amplifiers
        await head.stop()


async def test_homing_is_valid_again_once_the_amplifiers_answer(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        await head.home(["pan"])
    sim.bench.inject("wire.stall", line="servo-amps", seconds=1.0)
    async with sim.open() as head:
        assert not Mc3000Drive.of(head).axes["pan"].homed
    await asyncio.sleep(1.0)
    async with sim.open() as head:
        assert Mc3000Drive.of(head).axes["pan"].homed


@pytest.mark.parametrize("after", [0.1, 2.0], ids=["before its amplifiers notice", "after they noticed"])
async def test_amplifiers_that_a_dead_host_left_enabled_are_inhibited_for_good(
    sim: SimulatedHead, after: float
) -> None:
    async with AmplifierLine(sim.amps) as line:
        for address in (1, 4):
            await line.amplifier(address).enable()
            await line.amplifier(address).watchdog(1000)
    await asyncio.sleep(after)
    async with sim.open() as head:
        assert await head.clear() == {}
    joints = sim.bench.state()["head"]["joints"]
    assert {joint["bridge"] for joint in joints.values()} == {"inhibited"}
    # Nobody feeds the amplifiers now, and none of them latches a fault.
    await asyncio.sleep(10.0)
    async with sim.open() as head:
        await head.enable()
        assert not any(Cause.DRIVE in joint.latched for joint in (await head.read()).joints.values())
