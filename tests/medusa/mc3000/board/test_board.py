"""Every operation of the board's page, driven through a pty against the emulated board."""

import asyncio
import math
from collections.abc import AsyncIterator

import pytest

from medusa.errors import CommandError, ProtocolError
from medusa.link import Line
from medusa.mc3000.board import (
    Board,
    BoardEvent,
    EventKind,
    FilterBytes,
    Flags,
    Inputs,
    LatchSource,
    Mode,
    Profile,
    Register,
    Settings,
    Status,
    WatchdogAction,
)
from medusa.simulation import SimulatedHead

PAN, SPARE = 0, 1
FILTER = FilterBytes(197, 0, 7, 255)


@pytest.fixture
async def board(sim: SimulatedHead) -> AsyncIterator[Board]:
    async with Line(sim.boards, seed=0) as line:
        driver = Board(line.session(2))
        await driver.open()
        yield driver


async def in_control(board: Board, axis: int = SPARE, mode: Mode = Mode.POSITION) -> None:
    await board.filter(axis, FILTER)
    await board.profile(axis, Profile(256, 10))
    await board.mode(axis, mode)


async def test_hello_reports_three_axes_at_two_megahertz(board: Board) -> None:
    assert board.session.hello is not None
    assert board.clock_hz == 2_000_000
    assert board.boot_count == board.session.hello.boot_count


async def test_a_device_that_never_answered_has_no_clock(sim: SimulatedHead) -> None:
    async with Line(sim.boards, seed=0) as line:
        with pytest.raises(ProtocolError, match="02H has not answered a HELLO"):
            _ = Board(line.session(2)).clock_hz


async def test_read_and_write_run_over_ascending_registers(board: Board) -> None:
    await board.write(SPARE, Register.FILTER_ZERO, bytes([1, 2, 3]))
    assert await board.read(SPARE, Register.FILTER_ZERO, 3) == bytes([1, 2, 3])
    assert await board.read(SPARE, Register.FILTER_POLE) == bytes([2])


@pytest.mark.parametrize("count", [0, 9])
async def test_more_than_eight_registers_are_refused_before_they_are_sent(board: Board, count: int) -> None:
    with pytest.raises(CommandError, match=f"1 to 8 registers, not {count}"):
        await board.read(SPARE, 0x20, count)
    with pytest.raises(CommandError, match=f"1 to 8 bytes, not {count}"):
        await board.write(SPARE, 0x20, bytes(count))


async def test_a_reserved_register_is_refused_by_the_board(board: Board) -> None:
    with pytest.raises(CommandError) as refused:
        await board.read(SPARE, 0x30)
    assert refused.value.status == 5


async def test_24_bit_positions_are_read_in_the_order_in_which_the_chip_keeps_them(board: Board) -> None:
    await board.preset(SPARE, -1234)
    assert await board.position(SPARE) == -1234
    assert await board.read_position24(SPARE, Register.ACTUAL_POSITION_MSB) == -1234
    await board.write_position24(SPARE, Register.FINAL_POSITION_LSB, -77)
    assert await board.read(SPARE, Register.FINAL_POSITION_LSB, 3) == bytes([0xB3, 0xFF, 0xFF])
    assert await board.read_position24(SPARE, Register.FINAL_POSITION_LSB) == -77


@pytest.mark.parametrize("counts", [2**23, -(2**23) - 1])
async def test_a_position_outside_24_bits_is_refused_with_the_limit(board: Board, counts: int) -> None:
    with pytest.raises(CommandError, match=f"{counts} counts is outside -8388608..8388607"):
        await board.preset(SPARE, counts)
    with pytest.raises(CommandError, match="outside"):
        await board.move(SPARE, counts)
    with pytest.raises(CommandError, match="outside"):
        await board.command(SPARE, counts)


async def test_filter_and_profile_read_back_as_written(board: Board) -> None:
    await board.filter(SPARE, FILTER)
    await board.profile(SPARE, Profile(0x1234, 118))
    assert await board.read_filter(SPARE) == FILTER
    assert await board.read_profile(SPARE) == Profile(0x1234, 118)


async def test_a_byte_that_does_not_fit_is_refused_by_name(board: Board) -> None:
    with pytest.raises(CommandError, match="FILTER: K 256 is outside 0…255"):
        await board.filter(SPARE, FilterBytes(0, 0, 256, 255))


async def test_mode_command_and_settings(board: Board) -> None:
    await board.following(SPARE, 500)
    await in_control(board)
    await board.command(SPARE, 3)
    assert await board.settings(SPARE) == Settings(Mode.POSITION, 500, True, False)
    snapshot = await board.snapshot()
    assert snapshot.axes[SPARE].command == 3
    assert snapshot.axes[SPARE].mode is Mode.POSITION
    await board.mode(SPARE, Mode.IDLE)
    assert (await board.snapshot()).axes[SPARE].mode is Mode.IDLE


async def test_control_without_a_filter_is_refused(board: Board) -> None:
    with pytest.raises(CommandError) as refused:
        await board.mode(SPARE, Mode.POSITION)
    assert refused.value.status == 6


async def test_velocity_in_both_velocity_modes(board: Board) -> None:
    await in_control(board, mode=Mode.PROPORTIONAL_VELOCITY)
    await board.velocity(SPARE, -16)
    assert await board.read(SPARE, Register.PROPORTIONAL_VELOCITY_LSB, 2) == bytes([0xF0, 0xFF])
    await board.mode(SPARE, Mode.IDLE)
    await board.mode(SPARE, Mode.INTEGRAL_VELOCITY)
    await board.velocity(SPARE, 5)
    assert await board.read(SPARE, Register.INTEGRAL_VELOCITY) == bytes([5])
    assert (await board.snapshot()).axes[SPARE].mode is Mode.INTEGRAL_VELOCITY


async def test_an_armed_move_waits_for_start_and_reports_its_end(board: Board) -> None:
    events: list[BoardEvent] = []
    board.subscribe(events.append)
    await in_control(board)
    await board.move(SPARE, 100, start=False)
    assert (await board.settings(SPARE)).armed
    await board.start(1 << SPARE)
    # D/v + v/a = 100/10 + 10 samples of 2.048 ms = 41 ms, and an event on the line.
    await asyncio.sleep(0.06)
    assert [(e.kind, e.axis) for e in events] == [(EventKind.PROFILE_DONE, SPARE)]
    assert (await board.snapshot()).axes[SPARE].command == 100


async def test_start_of_an_axis_that_is_not_armed_is_refused(board: Board) -> None:
    with pytest.raises(CommandError) as refused:
        await board.start(0b010)
    assert refused.value.status == 6


async def test_stop_ends_a_profile_and_disarms(board: Board) -> None:
    await in_control(board)
    await board.move(SPARE, 100_000)
    await asyncio.sleep(0.05)
    await board.stop(SPARE)
    await asyncio.sleep(0.1)
    snapshot = await board.snapshot()
    assert not snapshot.axes[SPARE].flags & Flags.PROFILE
    assert 0 < snapshot.axes[SPARE].command < 1000


async def test_inputs_and_the_limit_latch(sim: SimulatedHead, board: Board) -> None:
    events: list[BoardEvent] = []
    board.subscribe(events.append)
    assert await board.inputs(PAN) == Inputs(0)
    sim.bench.inject("head.switch", axis="pan", side="negative", held="closed")
    await asyncio.sleep(0.05)
    assert await board.inputs(PAN) == Inputs.NEGATIVE_LIMIT | Inputs.LIMIT_LATCHED
    assert events[0].kind is EventKind.LIMIT_REACHED
    assert events[0].inputs & Inputs.NEGATIVE_LIMIT
    await board.clear(PAN)
    assert await board.inputs(PAN) & Inputs.LIMIT_LATCHED
    await board.limit_enable(PAN, False)
    await board.clear(PAN)
    assert await board.inputs(PAN) == Inputs.NEGATIVE_LIMIT
    assert not (await board.settings(PAN)).limit_enable


async def test_limit_enable_is_refused_off_in_control(board: Board) -> None:
    await in_control(board)
    with pytest.raises(CommandError) as refused:
        await board.limit_enable(SPARE, False)
    assert refused.value.status == 6


async def test_the_latch_catches_the_home_edge(sim: SimulatedHead, board: Board) -> None:
    events: list[BoardEvent] = []
    board.subscribe(events.append)
    await board.latch(PAN, LatchSource.HOME_RISING)
    assert (await board.latched(PAN)).source is LatchSource.HOME_RISING
    # By hand from −23° at 277.778 counts/°; the edge at −20° lies 3° on, the joint ends 4° on.
    sim.bench.inject("head.place", axis="pan", angle=math.radians(-19))
    await asyncio.sleep(0.05)
    caught = await board.latched(PAN)
    assert (caught.source, caught.caught) == (LatchSource.DISARMED, True)
    assert 833 <= caught.position <= 1112
    assert [(e.kind, e.position) for e in events] == [(EventKind.LATCH_CAUGHT, caught.position)]
    await board.latch(PAN, LatchSource.DISARMED)
    assert not (await board.latched(PAN)).caught


async def test_the_mark_is_kept_until_the_count_is_invalid(board: Board) -> None:
    assert await board.read_mark(SPARE) == bytes(4)
    await board.write_mark(SPARE, b"mark")
    assert await board.read_mark(SPARE) == b"mark"
    await board.preset(SPARE, 5)
    assert await board.read_mark(SPARE) == bytes(4)


async def test_open_loop_output_needs_the_watchdog(board: Board) -> None:
    with pytest.raises(CommandError) as refused:
        await board.write(SPARE, Register.MOTOR_COMMAND, bytes([0x84]))
    assert refused.value.status == 6
    await board.watchdog(200, WatchdogAction.IDLE)
    await board.write(SPARE, Register.MOTOR_COMMAND, bytes([0x84]))
    assert (await board.snapshot()).axes[SPARE].motor_command == 4


async def test_an_unfed_watchdog_idles_every_axis_and_reports_it(board: Board) -> None:
    events: list[BoardEvent] = []
    board.subscribe(events.append)
    await in_control(board)
    await board.watchdog(100, WatchdogAction.IDLE)
    await asyncio.sleep(0.15)
    snapshot = await board.snapshot()
    assert snapshot.axes[SPARE].mode is Mode.IDLE
    assert all(axis.inputs & Inputs.WATCHDOG_EXPIRED for axis in snapshot.axes)
    assert [(e.kind, e.axis, e.detail) for e in events] == [(EventKind.WATCHDOG_EXPIRED, None, 0)]


async def test_ping_and_snapshots_carry_the_boards_time(board: Board) -> None:
    loop = asyncio.get_running_loop()
    first = await board.ping()
    await asyncio.sleep(1.0)
    assert await board.ping() - first == pytest.approx(1_000_000, abs=10_000)
    asked = loop.time()
    _, instant = await board.timed_snapshot()
    # The request takes 8 bytes, 0.7 ms, to arrive; the snapshot shows the instant of its arrival.
    assert asked < instant < asked + 0.002


async def test_a_snapshot_shows_three_axes_at_rest_after_power_up(board: Board) -> None:
    snapshot = await board.snapshot()
    assert [axis.actual for axis in snapshot.axes] == [0, 0, 0]
    assert all(axis.mode is Mode.IDLE and axis.motor_command == 0 for axis in snapshot.axes)
    assert all(axis.status & Status.IDLE and axis.status & Status.LIMIT_RELEASED for axis in snapshot.axes)


async def test_soft_reset_through_the_program_counter(board: Board) -> None:
    await in_control(board)
    await board.write(SPARE, Register.PROGRAM_COUNTER, b"\x00")
    # A, B, K after a reset of the chip (docs/protocols, HCTL-1100).
    assert await board.read(SPARE, Register.FILTER_ZERO, 3) == bytes([0xE5, 0x40, 0x40])
    assert (await board.snapshot()).axes[SPARE].mode is Mode.IDLE
