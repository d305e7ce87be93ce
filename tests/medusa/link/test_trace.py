"""The wire trace: what it says, and that it never gets in the way."""

import logging
from pathlib import Path

import pytest

from medusa.link import Line, Trace
from sim_devices.link.device import Application, LinkDevice
from sim_devices.link.line import Line as EmulatedLine
from tests.medusa.link.toy_operations import ADD


async def test_each_line_tells_time_direction_bytes_and_meaning(toy: Application, tmp_path: Path) -> None:
    trace = Trace(tmp_path / "wire.txt")
    async with (
        EmulatedLine([LinkDevice(1, toy, boot_count=7)]) as emulated,
        Line(emulated.path, trace=trace, name="mc3000", seed=5) as line,
    ):
        session = line.session(1)
        session.describe([ADD], {}, event_size=None)
        await session.open()
        await session.request(ADD, 2, b"\x07")
        line.ping_all()
    trace.close()
    lines = (tmp_path / "wire.txt").read_text().splitlines()
    assert lines[0].split()[:4] == ["0.000000", "mc3000", ">", lines[0].split()[3]]
    assert lines[0].endswith(f"01 request #0 HELLO {session.hello.nonce.to_bytes(2, 'little').hex()}")
    assert " mc3000 < " in lines[1]
    assert " 01 reply #0 HELLO status 0 " in lines[1]
    # Checked by hand: 01 01 32 02 07 and a CRC without a zero: COBS only puts 08 in front.
    assert " > 08010132" in lines[2]
    assert lines[2].endswith("01 request #1 ADD axis 2 07")
    assert lines[-1].endswith("00 request #0 PING")


async def test_what_was_dropped_is_traced_with_the_reason(toy: Application, tmp_path: Path) -> None:
    trace = Trace(tmp_path / "wire.txt")
    async with (
        EmulatedLine([LinkDevice(1, toy, boot_count=7)]) as emulated,
        Line(emulated.path, trace=trace) as line,
    ):
        line._received(b"\x02\x05\x00")
    trace.close()
    assert (tmp_path / "wire.txt").read_text().split("< ")[1] == "0205 dropped: too short\n"


async def test_a_full_disk_ends_the_trace_with_one_warning_and_not_the_machine(
    toy: Application, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING)
    trace = Trace("/dev/full")
    async with (
        EmulatedLine([LinkDevice(1, toy, boot_count=7)]) as emulated,
        Line(emulated.path, trace=trace) as line,
    ):
        await line.session(1).open()
        for _ in range(500):
            await line.session(1).ping()
    trace.close()
    warnings = [record.message for record in caplog.records if "trace" in record.message]
    assert len(warnings) == 1
    assert "No space left" in warnings[0]


def test_a_trace_that_cannot_be_made_says_so_at_once(tmp_path: Path) -> None:
    with pytest.raises(OSError):
        Trace(tmp_path / "missing" / "wire.txt")
