"""The amplifiers' driver against the emulated head's line: 01H left vergence … 04H pan."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from medusa.errors import CommandError, DeviceFault, NoReply, PortError
from medusa.servo_amp import AmplifierLine
from medusa.servo_amp.registers import CONTROL, POSITION, AmplifierRegister
from sim_devices.bench import Bench
from sim_devices.head import HeadMachine
from sim_devices.link.faults import FaultPlan


@asynccontextmanager
async def amplifiers(
    faults: FaultPlan | None = None,
) -> AsyncIterator[tuple[AmplifierLine, HeadMachine, Bench]]:
    machine = HeadMachine(seed=3)
    plans = {"servo-amps": faults} if faults is not None else None
    async with (
        Bench({"head": machine}, seed=3, faults=plans) as bench,
        AmplifierLine(bench.ports["servo-amps"]) as line,
    ):
        yield line, machine, bench


async def test_at_power_up_an_amplifier_is_inhibited_and_reports_that_it_was_reset() -> None:
    async with amplifiers() as (line, _, _):
        status = await line.amplifier(1).status()
        assert not status.enabled
        assert status.was_reset
        assert status.faults == ()
        assert "commanded inhibit" in status.drive_1


async def test_enable_and_inhibit_are_confirmed_by_reading_back() -> None:
    async with amplifiers() as (line, _, _):
        for address in (1, 2, 3, 4):
            amplifier = line.amplifier(address)
            assert (await amplifier.enable()).enabled
            assert not (await amplifier.inhibit()).enabled


async def test_a_write_without_access_takes_it_and_is_tried_again() -> None:
    async with amplifiers() as (line, _, _):
        with pytest.raises(CommandError, match="no write access") as refused:
            await line.write(2, CONTROL, b"\x00\x00")
        assert refused.value.status == 6
        await line.amplifier(2).watchdog(500)
        assert await line.read(2, AmplifierRegister(0x04, 0x01)) == (500).to_bytes(2, "little")


async def test_reset_events_clears_was_reset_and_leaves_an_inhibited_amplifier_inhibited() -> None:
    async with amplifiers() as (line, _, _):
        status = await line.amplifier(3).reset_events()
        assert not status.was_reset
        assert not status.enabled


async def test_a_latched_fault_is_named_refuses_enable_and_is_released_when_its_cause_is_gone() -> None:
    async with amplifiers() as (line, _, bench):
        pan = line.amplifier(4)
        await pan.enable()
        bench.inject("head.amplifier_fault", axis="pan", fault="over_temperature")
        status = await pan.status()
        assert not status.enabled
        assert status.faults == ("over-temperature",)
        with pytest.raises(DeviceFault, match=r"04H.*over-temperature") as fault:
            await pan.enable()
        assert fault.value.axis == 4
        bench.inject("head.amplifier_fault", axis="pan", fault="over_temperature", on=False)
        remains = await pan.reset_events()
        assert remains.faults == ()
        # The fault alone inhibited it; resetting must not enable it.
        assert not remains.enabled
        assert (await pan.enable()).enabled


async def test_measurements_come_in_si_units() -> None:
    async with amplifiers() as (line, _, _):
        tilt = line.amplifier(3)
        # The bus of the page: 480 units of 0.1 V.
        assert await tilt.bus_voltage() == pytest.approx(48.0)
        assert await tilt.current() == 0.0
        assert await tilt.velocity_counts_s() == 0.0
        # Zero at power-up.
        assert await tilt.position_counts() == 0
        assert await tilt.name() != ""


async def test_the_brake_shows_while_the_amplifier_is_not_enabled() -> None:
    async with amplifiers() as (line, _, _):
        amplifier = line.amplifier(1)
        await amplifier.enable()
        status = await amplifier.brake(True)
        assert status.braked
        assert not status.enabled
        assert not (await amplifier.brake(False)).braked


async def test_an_unknown_register_is_a_command_error_with_the_register() -> None:
    async with amplifiers() as (line, _, _):
        with pytest.raises(CommandError, match=r"amplifier 02H, read 7F\.00: invalid command") as refused:
            await line.read(2, AmplifierRegister(0x7F, 0x00))
        assert refused.value.status == 4


async def test_a_missing_amplifier_is_no_reply_after_three_sendings() -> None:
    async with amplifiers() as (line, _, _):
        loop = asyncio.get_running_loop()
        await line.read(1, POSITION)
        start = loop.time()
        with pytest.raises(NoReply, match=r"09H.*3 sendings"):
            await line.read(9, POSITION)
        # 50 ms and the wire's time for each of three.
        assert 0.15 <= loop.time() - start < 0.2
        assert line.counters.repeats == 2


async def test_commands_of_several_tasks_go_one_at_a_time() -> None:
    async with amplifiers() as (line, _, _):
        values = await asyncio.gather(*(line.amplifier(1 + n % 4).bus_voltage() for n in range(40)))
        assert values == pytest.approx([48.0] * 40)
        assert line.counters.late_replies == 0
        assert line.counters.repeats == 0


async def test_a_cancelled_command_is_waited_out_and_its_answer_swallowed() -> None:
    async with amplifiers() as (line, _, _):
        for wait in (0.0001, 0.0005, 0.001, 0.0015, 0.002):
            with pytest.raises(TimeoutError):
                async with asyncio.timeout(wait):
                    await line.read(1, AmplifierRegister(0x0B, 0x00, 128))
            assert await line.amplifier(2).position_counts() == 0
        assert line.counters.repeats == 0


async def test_a_vanished_port_ends_the_command_at_once_and_is_opened_again() -> None:
    async with amplifiers() as (line, _, bench):
        amplifier = line.amplifier(1)
        await amplifier.enable()
        reading = asyncio.create_task(amplifier.name())
        await asyncio.sleep(0.001)
        bench.inject("wire.unplug", line="servo-amps")
        with pytest.raises(PortError, match="vanished"):
            await reading
        with pytest.raises(PortError, match="being opened again"):
            await amplifier.status()
        bench.inject("wire.plug", line="servo-amps")
        await asyncio.sleep(3.0)
        assert (await amplifier.status()).enabled


@pytest.mark.parametrize(
    "plan",
    [
        FaultPlan(seed=1, drop=0.1),
        FaultPlan(seed=2, flip=0.1),
        FaultPlan(seed=3, insert=0.1),
        FaultPlan(seed=4, double=0.2),
        FaultPlan(seed=5, delay=0.05, delay_s=0.15),
        FaultPlan(seed=6, split=0.3, split_s=0.008),
        FaultPlan(seed=7, drop=0.05, flip=0.05, insert=0.05, double=0.1, delay=0.03, delay_s=0.15, split=0.1),
    ],
    ids=["lost", "flipped", "inserted", "doubled", "late", "split", "all"],
)
async def test_whatever_the_line_does_no_answer_is_taken_for_another(plan: FaultPlan) -> None:
    async with amplifiers(plan) as (line, _, _):
        # What each register must hold: a late answer of another command would differ in value or size.
        expected = {
            AmplifierRegister(0x0F, 0x00): (480).to_bytes(2, "little"),
            AmplifierRegister(0x04, 0x01): bytes(2),
            POSITION: bytes(4),
            AmplifierRegister(0x02, 0x00, 2): b"\x00\x00\x01\x00",
        }
        answered = 0
        for number in range(150):
            register = list(expected)[number % 4]
            try:
                async with asyncio.timeout(0.001 if number % 10 == 9 else None):
                    data = await line.read(1 + number % 4, register)
            except (NoReply, TimeoutError):
                continue
            assert data == expected[register], number
            answered += 1
        assert answered > 100
        failures = line.counters.repeats + line.counters.rejected + line.counters.late_replies
        # Splits within 10 ms do no harm; everything else must have been met and survived.
        assert failures > 0 or plan.split == 0.3
