"""The port: what cannot be opened, what hangs up, who does not read, and that none of it holds the loop."""

import asyncio
import os
import pty
import tty
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path

import pytest

from medusa.errors import NoReply, PortError
from medusa.link import Line
from medusa.link.port import Port, open_serial


class Pty:
    """Both ends of a raw pseudo-terminal; nobody answers on it."""

    def __init__(self) -> None:
        self.master, self.slave = pty.openpty()
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.path = os.ttyname(self.slave)

    def hang_up(self) -> None:
        for end in ("slave", "master"):
            if (fd := getattr(self, end)) >= 0:
                os.close(fd)
                setattr(self, end, -1)


@pytest.fixture
def terminal() -> Iterator[Pty]:
    terminal = Pty()
    yield terminal
    terminal.hang_up()


class Ends:
    """Takes what a port tells."""

    def __init__(self) -> None:
        self.data = b""
        self.lost: list[str] = []

    def port(self, path: str) -> Port:
        return Port(path, 115200, self.received, self.lost.append)

    def received(self, data: bytes) -> None:
        self.data += data


def turns(loop: asyncio.AbstractEventLoop) -> list[int]:
    """Count how often the loop looks for ready descriptors."""
    count = [0]
    selector = loop._selector  # type: ignore[attr-defined]
    select = selector.select

    def counted(timeout: float | None = None) -> object:
        count[0] += 1
        return select(timeout)

    selector.select = counted
    return count


async def test_a_missing_port_is_said_in_one_line() -> None:
    with pytest.raises(PortError, match=r"^/dev/no-such-tty: no such port$"):
        Ends().port("/dev/no-such-tty").open()


@pytest.mark.parametrize("path", ["/dev/null", "/proc/self/status", "/"])
async def test_what_is_no_serial_port_is_said_so(path: str) -> None:
    with pytest.raises(PortError, match="not a serial port"):
        Ends().port(path).open()


async def test_a_port_that_another_has_open_is_busy(terminal: Pty) -> None:
    first, second = Ends().port(terminal.path), Ends().port(terminal.path)
    first.open()
    with pytest.raises(PortError, match="busy"):
        second.open()
    first.close()
    second.open()
    second.close()


async def test_a_port_without_permission_is_said_with_its_group(terminal: Pty) -> None:
    os.chmod(terminal.path, 0)
    root = os.geteuid() == 0
    if root:
        os.seteuid(65534)
    try:
        with pytest.raises(PortError, match=r"permission denied .*group"):
            Ends().port(terminal.path).open()
    finally:
        if root:
            os.seteuid(0)


async def test_bytes_go_both_ways_unchanged(terminal: Pty) -> None:
    ends = Ends()
    port = ends.port(terminal.path)
    port.open()
    everything = bytes(range(256))
    port.write(everything)
    os.write(terminal.master, everything)
    await asyncio.sleep(0.01)
    assert os.read(terminal.master, 4096) == everything
    assert ends.data == everything
    port.close()


async def test_a_peer_that_reads_late_gets_every_frame_whole_and_in_order(terminal: Pty) -> None:
    port = Ends().port(terminal.path)
    port.open()
    frames = [b"%04d" % n * 20 + b"\0" for n in range(1000)]
    for frame in frames:
        port.write(frame)
    assert port.backlog_bytes > 0
    got = b""
    while port.backlog_bytes or len(got) < sum(map(len, frames)):
        try:
            # An odd size, so that frames are cut anywhere.
            got += os.read(terminal.master, 777)
        except BlockingIOError:
            await asyncio.sleep(0.001)
    assert got == b"".join(frames)
    port.close()


async def test_what_goes_ahead_waits_only_for_the_rest_of_a_frame_that_has_begun(terminal: Pty) -> None:
    port = Ends().port(terminal.path)
    port.open()
    for n in range(1000):
        port.write(b"%04d" % n * 20 + b"\0")
    port.write_ahead(b"STOP\0")
    got = b""
    while len(got) < 1000 * 81 + 5:
        try:
            got += os.read(terminal.master, 4096)
        except BlockingIOError:
            await asyncio.sleep(0.001)
    frames = got.split(b"\0")[:-1]
    place = frames.index(b"STOP")
    assert place < 500
    assert frames[:place] + frames[place + 1 :] == [b"%04d" % n * 20 for n in range(1000)]
    port.close()


async def test_a_frame_that_waits_can_be_taken_back_one_that_left_cannot(terminal: Pty) -> None:
    port = Ends().port(terminal.path)
    port.open()
    gone = b"gone\0"
    port.write(gone)
    for n in range(1000):
        port.write(b"%04d" % n * 20 + b"\0")
    assert not port.dequeue(gone)
    assert port.dequeue(b"0999" * 20 + b"\0")
    assert not port.dequeue(b"0999" * 20 + b"\0")
    port.close()


async def test_a_hang_up_is_told_once_and_costs_no_turns_of_the_loop(terminal: Pty) -> None:
    # POLLHUP stays ready for ever: a reader left on the descriptor would spin.
    ends = Ends()
    port = ends.port(terminal.path)
    port.open()
    count = turns(asyncio.get_running_loop())
    terminal.hang_up()
    await asyncio.sleep(1.0)
    assert len(ends.lost) == 1
    assert "vanished" in ends.lost[0]
    assert not port.is_open
    assert count[0] < 20


async def test_writing_to_a_port_that_hung_up_tells_it_too(terminal: Pty) -> None:
    ends = Ends()
    port = ends.port(terminal.path)
    port.open()
    terminal.hang_up()
    port.write(b"x\0")
    await asyncio.sleep(0.01)
    assert len(ends.lost) == 1


async def test_a_quiet_port_costs_no_turns_of_the_loop(terminal: Pty) -> None:
    port = Ends().port(terminal.path)
    port.open()
    count = turns(asyncio.get_running_loop())
    await asyncio.sleep(10.0)
    assert count[0] < 5
    port.close()


async def test_a_peer_that_stops_reading_ends_requests_in_time_and_piles_nothing_up(terminal: Pty) -> None:
    loop = asyncio.get_running_loop()
    async with Line(terminal.path) as line:
        # Fill what the driver holds, as a peer that stopped reading long ago leaves it.
        while not line._port.backlog_bytes:
            line.write(b"\x01" * 64)
        held = line._port.backlog_bytes
        start = loop.time()
        with pytest.raises(NoReply, match="takes no bytes; it did not act"):
            await line.session(1).open()
        assert loop.time() - start == pytest.approx(0.1, abs=0.01)
        for _ in range(50):
            with pytest.raises(NoReply):
                await line.session(1).open()
        assert line._port.backlog_bytes <= held


@pytest.mark.real_time
async def test_a_flood_of_garbage_leaves_the_loop_to_others(terminal: Pty) -> None:
    # Each read is bounded, so that others get their turn between any two: counted in turns, not in seconds.
    async with Line(terminal.path) as line:
        os.set_blocking(terminal.master, False)
        dropped, others = line.decoder, 0
        sent = 0
        while sent < 1_000_000:
            with suppress(BlockingIOError):
                sent += os.write(terminal.master, os.urandom(4096))
            await asyncio.sleep(0)
            others += 1
        assert others >= sent // 4096
        assert dropped.framing_errors + dropped.crc_errors > 1000


def test_the_port_is_opened_low_latency_where_the_driver_can(
    terminal: Pty, caplog: pytest.LogCaptureFixture
) -> None:
    # A pty cannot: that is no error, and worth no more than a debug line.
    caplog.set_level("DEBUG")
    open_serial(terminal.path, 115200).close()
    assert any("low-latency" in record.message and record.levelname == "DEBUG" for record in caplog.records)


def test_a_baud_rate_that_cannot_be_is_said_with_its_value(terminal: Pty) -> None:
    with pytest.raises(PortError, match="baud rate -5"):
        open_serial(terminal.path, -5)


def test_no_descriptor_is_left_behind_by_failures(terminal: Pty) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    for path in ("/dev/null", "/dev/no-such-tty", terminal.path):
        for _ in range(5):
            try:
                open_serial(path, -5)
            except PortError:
                continue
    assert len(list(Path("/proc/self/fd").iterdir())) == before
