"""The line: pacing, framing of bytes in time, and its clients, over real pseudo-terminals."""

import asyncio
import os
import resource
import termios
import tty

import pytest

from sim_devices.link.frame import encode_frame
from sim_devices.link.line import Line

BYTE = 10 / 115200
PING = 2


async def test_a_byte_takes_86_8_us_each_way(make_echo, connect):
    async with Line([make_echo()]) as line:
        client = connect(line.path)
        client.write(b"x" * 100)
        await asyncio.sleep(1.0)
        client.close()
        assert client.got == [(pytest.approx(200 * BYTE, abs=1e-9), b"x" * 100)]


async def test_deadlines_are_absolute_so_that_nothing_adds_up(make_echo, connect):
    echo = make_echo()
    async with Line([echo]) as line:
        client = connect(line.path)
        for n in range(1000):
            client.write(bytes((n % 250 + 1,)) * 7)
            await asyncio.sleep(1e-6)
        await asyncio.sleep(2.0)
        client.close()
    # 7000 bytes one behind the other, however they were cut: the last stop bit falls where arithmetic has it.
    assert echo.heard[-1][0] == pytest.approx(7000 * BYTE, abs=1e-6)
    assert sum(len(data) for _, data in echo.heard) == 7000
    assert client.got[-1][0] == pytest.approx(7000 * BYTE + len(echo.heard[-1][1]) * BYTE, abs=1e-6)


@pytest.mark.parametrize("baud", [9600, 115200, 1_000_000])
async def test_the_pace_follows_the_configured_rate(baud, make_echo, connect):
    async with Line([make_echo()], baud) as line:
        client = connect(line.path)
        client.write(b"y" * 24)
        await asyncio.sleep(1.0)
        client.close()
    assert client.got[0][0] == pytest.approx(48 * 10 / baud, abs=1e-9)


async def test_an_unpaced_answer_waits_for_the_frame_before_it(make_echo, connect):
    echo = make_echo()
    async with Line([echo]) as line:
        client = connect(line.path)
        echo.send(b"a" * 20, 0.0)
        echo.send(b"b" * 20, 0.0)
        await asyncio.sleep(0.1)
        client.close()
    assert client.got == [
        (pytest.approx(20 * BYTE), b"a" * 20),
        (pytest.approx(40 * BYTE), b"b" * 20),
    ]


async def test_devices_in_a_chain_all_hear_and_never_interleave(make_echo, connect):
    first, second = make_echo(), make_echo()
    async with Line([first, second]) as line:
        client = connect(line.path)
        client.write(b"12345678")
        await asyncio.sleep(0.1)
        client.close()
    assert first.heard == second.heard
    assert client.bytes == b"1234567812345678"
    assert client.got[-1][0] == pytest.approx(24 * BYTE)


async def test_framed_devices_get_each_frame_at_its_own_last_byte(hand, connect):
    heard = []
    hand.device.receive = lambda data, t: heard.append((t, data))
    async with Line([hand.device]) as line:
        client = connect(line.path)
        one, two = encode_frame(1, 0, 1, PING, 15), encode_frame(1, 0, 2, PING, 15)
        client.write(one + two + b"\x03")
        await asyncio.sleep(0.1)
        client.close()
    ends = [len(one), len(one + two), len(one + two) + 1]
    assert [data for _, data in heard] == [one, two, b"\x03"]
    assert [t for t, _ in heard] == pytest.approx([end * BYTE for end in ends])


async def test_a_device_is_woken_when_it_is_due(make_echo):
    echo = make_echo()
    echo.dues = [0.5, 0.7]
    async with Line([echo]):
        await asyncio.sleep(1.0)
    assert echo.advanced == [0.5, 0.7]


async def test_a_device_that_stays_due_does_not_hold_the_clock_still(make_echo):
    echo = make_echo()
    echo.next_due = lambda: 0.5
    async with Line([echo]):
        await asyncio.sleep(0.6)
    assert 50 < len(echo.advanced) < 150


async def test_rearming_notices_what_became_due_out_of_band(make_echo):
    echo = make_echo()
    async with Line([echo]) as line:
        await asyncio.sleep(0.1)
        echo.dues = [0.2]
        line.rearm()
        await asyncio.sleep(0.2)
    assert echo.advanced == [0.2]


async def test_an_exception_in_device_code_is_logged_and_the_port_lives(caplog, make_echo, connect):
    broken = make_echo()
    broken.breaks = True
    async with Line([broken, make_echo()]) as line:
        client = connect(line.path)
        client.write(b"one")
        await asyncio.sleep(0.1)
        client.write(b"two")
        await asyncio.sleep(0.1)
        client.close()
    assert "a fault in device code" in caplog.text
    assert client.bytes == b"onetwo"


async def test_a_device_whose_physics_fail_is_left_alone_for_a_while(caplog, make_echo, connect):
    def fail(t):
        calls.append(t)
        raise ArithmeticError("physics")

    calls = []
    broken = make_echo()
    broken.advance_to = fail
    broken.next_due = lambda: 0.0
    async with Line([broken]) as line:
        client = connect(line.path)
        await asyncio.sleep(1.0)
        client.write(b"still here")
        await asyncio.sleep(0.1)
        client.close()
    assert client.bytes == b"still here"
    # Once every 100 ms, and once more for what was received.
    assert len(calls) < 30


async def test_is_raw_from_the_start_so_that_every_byte_passes(make_echo, connect):
    async with Line([make_echo()]) as line:
        client = connect(line.path)
        iflag, oflag, _, lflag, *_ = termios.tcgetattr(client.fd)
        assert not lflag & (termios.ECHO | termios.ICANON | termios.ISIG)
        assert not iflag & (termios.IXON | termios.ICRNL | termios.ISTRIP)
        assert not oflag & termios.OPOST
        client.write(bytes(range(256)))
        await asyncio.sleep(1.0)
        client.close()
    assert client.bytes == bytes(range(256))


async def test_several_clients_come_one_after_the_other(make_echo, connect):
    async with Line([make_echo()]) as line:
        for text in (b"first", b"second", b"third"):
            client = connect(line.path)
            client.write(text)
            await asyncio.sleep(0.1)
            client.close()
            await asyncio.sleep(0.5)
            assert client.bytes == text


async def test_a_client_that_stops_reading_loses_bytes_but_stops_nobody(make_echo, connect):
    echo = make_echo()
    async with Line([echo], 4_000_000) as line:
        client = connect(line.path)
        client.loop.remove_reader(client.fd)
        for _ in range(100):
            echo.send(b"z" * 4000, client.loop.time())
            await asyncio.sleep(0.02)
        assert line.lost_bytes > 0
        client.loop.add_reader(client.fd, client._readable)
        await asyncio.sleep(0.1)
        passed = len(client.bytes)
        assert passed + line.lost_bytes == 400_000
        echo.send(b"heard again", client.loop.time())
        await asyncio.sleep(0.1)
        client.close()
        assert client.bytes.endswith(b"heard again")


async def test_a_client_that_floods_is_slowed_down_and_every_byte_arrives_once(make_echo, connect):
    echo = make_echo()
    echo.answer = False
    flood = bytes(n % 255 + 1 for n in range(60_000))
    async with Line([echo]) as line:
        client = connect(line.path)
        left, waited = flood, 0
        while left:
            try:
                left = left[os.write(client.fd, left) :]
            except BlockingIOError:
                waited += 1
            await asyncio.sleep(0.01)
        await asyncio.sleep(6.0)
        client.close()
    assert waited > 100
    assert b"".join(data for _, data in echo.heard) == flood
    assert echo.heard[-1][0] >= len(flood) * BYTE - 1e-6


async def test_a_pulled_cable_hangs_up_and_a_new_one_is_found_at_the_same_path(tmp_path, make_echo, connect):
    echo = make_echo()
    async with Line([echo], link=tmp_path / "port") as line:
        client = connect(line.path)
        client.write(b"lost on the way")
        await asyncio.sleep(0.0001)
        line.unplug()
        await asyncio.sleep(0.1)
        assert not client.open
        assert os.listdir(tmp_path) == []
        echo.send(b"into the air", 0.1)
        assert echo.heard == []
        line.plug()
        client = connect(line.path)
        client.write(b"back")
        await asyncio.sleep(0.1)
        client.close()
        assert client.bytes == b"back"
    assert os.listdir(tmp_path) == []


async def test_a_hang_up_ends_after_its_time(tmp_path, make_echo):
    async with Line([make_echo()], link=tmp_path / "port") as line:
        line.hang_up(2.0)
        await asyncio.sleep(1.99)
        assert not line.plugged
        await asyncio.sleep(0.02)
        assert line.plugged


async def test_a_stall_lets_nothing_onto_the_line_for_its_time(make_echo, connect):
    async with Line([make_echo()]) as line:
        client = connect(line.path)
        line.stall(0.3)
        client.write(b"late")
        await asyncio.sleep(1.0)
        client.close()
    assert client.got == [(pytest.approx(0.3 + 8 * BYTE), b"late")]


async def test_a_file_in_the_place_of_the_link_is_not_touched(tmp_path, make_echo):
    (tmp_path / "port").write_text("somebody's")
    line = Line([make_echo()], link=tmp_path / "port")
    with pytest.raises(FileExistsError):
        await line.start()
    await line.stop()
    assert (tmp_path / "port").read_text() == "somebody's"


async def test_a_stale_link_is_replaced(tmp_path, make_echo, connect):
    (tmp_path / "port").symlink_to("/dev/pts/nowhere")
    async with Line([make_echo()], link=tmp_path / "port") as line:
        connect(line.path).close()


@pytest.mark.real_time
async def test_without_a_client_nothing_is_busy(make_echo, connect):
    async with Line([make_echo()]) as line:
        client = connect(line.path)
        client.write(b"here and gone")
        client.close()
        before = resource.getrusage(resource.RUSAGE_SELF)
        await asyncio.sleep(0.5)
        after = resource.getrusage(resource.RUSAGE_SELF)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    # A loop that spins takes all of the half second; this one wakes a few times.
    assert used < 0.25


@pytest.mark.real_time
async def test_a_line_serves_on_the_wall_clock_too(make_echo, connect):
    async with Line([make_echo()]) as line:
        client = connect(line.path)
        tty.setraw(client.fd)
        client.write(b"real")
        for _ in range(1000):
            if client.bytes == b"real":
                break
            await asyncio.sleep(0.01)
        client.close()
    assert client.bytes == b"real"
