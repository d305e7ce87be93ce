"""The line: pacing, framing of bytes in time, clients, and faults of the wire, over real pseudo-terminals."""

import asyncio
import os
import resource
import termios
import tty

import pytest

from sim_devices.clock import run_virtual
from sim_devices.link.device import LinkDevice
from sim_devices.link.faults import FaultPlan
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame
from sim_devices.link.line import Line

BYTE = 10 / 115200
HELLO, PING = 1, 2


class Echo:
    """Sends back what it hears, at the instant at which it hears it."""

    def __init__(self) -> None:
        self.heard: list[tuple[float, bytes]] = []
        self.advanced: list[float] = []
        self.dues: list[float] = []
        self.answer = True
        self.breaks = False
        self.send = lambda data, t: None

    def receive(self, data: bytes, t: float) -> None:
        self.heard.append((t, data))
        if self.breaks:
            raise RuntimeError("a fault in device code")
        if self.answer:
            self.send(data, t)

    def advance_to(self, t: float) -> None:
        self.advanced.append(t)
        self.dues = [due for due in self.dues if due > t]

    def next_due(self) -> float | None:
        return min(self.dues, default=None)


class Client:
    """An application's end of the terminal."""

    def __init__(self, path: str) -> None:
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.got: list[tuple[float, bytes]] = []
        self.loop = asyncio.get_running_loop()
        self.loop.add_reader(self.fd, self._readable)
        self.open = True

    def _readable(self) -> None:
        try:
            data = os.read(self.fd, 4096)
        except OSError:
            data = b""
        if not data:
            self.close()
            return
        self.got.append((self.loop.time(), data))

    def write(self, data: bytes) -> None:
        assert os.write(self.fd, data) == len(data)

    @property
    def bytes(self) -> bytes:
        return b"".join(data for _, data in self.got)

    def close(self) -> None:
        if self.open:
            self.open = False
            self.loop.remove_reader(self.fd)
            os.close(self.fd)


async def test_a_byte_takes_86_8_us_each_way():
    async with Line([Echo()]) as line:
        client = Client(line.path)
        client.write(b"x" * 100)
        await asyncio.sleep(1.0)
        client.close()
        assert client.got == [(pytest.approx(200 * BYTE, abs=1e-9), b"x" * 100)]


async def test_deadlines_are_absolute_so_that_nothing_adds_up():
    echo = Echo()
    async with Line([echo]) as line:
        client = Client(line.path)
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
async def test_the_pace_follows_the_configured_rate(baud):
    async with Line([Echo()], baud) as line:
        client = Client(line.path)
        client.write(b"y" * 24)
        await asyncio.sleep(1.0)
        client.close()
    assert client.got[0][0] == pytest.approx(48 * 10 / baud, abs=1e-9)


async def test_an_unpaced_answer_waits_for_the_frame_before_it():
    echo = Echo()
    async with Line([echo]) as line:
        client = Client(line.path)
        echo.send(b"a" * 20, 0.0)
        echo.send(b"b" * 20, 0.0)
        await asyncio.sleep(0.1)
        client.close()
    assert client.got == [
        (pytest.approx(20 * BYTE), b"a" * 20),
        (pytest.approx(40 * BYTE), b"b" * 20),
    ]


async def test_devices_in_a_chain_all_hear_and_never_interleave():
    first, second = Echo(), Echo()
    async with Line([first, second]) as line:
        client = Client(line.path)
        client.write(b"12345678")
        await asyncio.sleep(0.1)
        client.close()
    assert first.heard == second.heard
    assert client.bytes == b"1234567812345678"
    assert client.got[-1][0] == pytest.approx(24 * BYTE)


async def test_framed_devices_get_each_frame_at_its_own_last_byte(hand):
    heard = []
    hand.device.receive = lambda data, t: heard.append((t, data))
    async with Line([hand.device]) as line:
        client = Client(line.path)
        one, two = encode_frame(1, 0, 1, PING, 15), encode_frame(1, 0, 2, PING, 15)
        client.write(one + two + b"\x03")
        await asyncio.sleep(0.1)
        client.close()
    ends = [len(one), len(one + two), len(one + two) + 1]
    assert [data for _, data in heard] == [one, two, b"\x03"]
    assert [t for t, _ in heard] == pytest.approx([end * BYTE for end in ends])


async def test_a_device_is_woken_when_it_is_due():
    echo = Echo()
    echo.dues = [0.5, 0.7]
    async with Line([echo]):
        await asyncio.sleep(1.0)
    assert echo.advanced == [0.5, 0.7]


async def test_a_device_that_stays_due_does_not_hold_the_clock_still():
    echo = Echo()
    echo.next_due = lambda: 0.5
    async with Line([echo]):
        await asyncio.sleep(0.6)
    assert 50 < len(echo.advanced) < 150


async def test_rearming_notices_what_became_due_out_of_band():
    echo = Echo()
    async with Line([echo]) as line:
        await asyncio.sleep(0.1)
        echo.dues = [0.2]
        line.rearm()
        await asyncio.sleep(0.2)
    assert echo.advanced == [0.2]


async def test_an_exception_in_device_code_is_logged_and_the_port_lives(caplog):
    broken = Echo()
    broken.breaks = True
    async with Line([broken, Echo()]) as line:
        client = Client(line.path)
        client.write(b"one")
        await asyncio.sleep(0.1)
        client.write(b"two")
        await asyncio.sleep(0.1)
        client.close()
    assert "a fault in device code" in caplog.text
    assert client.bytes == b"onetwo"


async def test_a_device_whose_physics_fail_is_left_alone_for_a_while(caplog):
    def fail(t):
        calls.append(t)
        raise ArithmeticError("physics")

    calls = []
    broken = Echo()
    broken.advance_to = fail
    broken.next_due = lambda: 0.0
    async with Line([broken]) as line:
        client = Client(line.path)
        await asyncio.sleep(1.0)
        client.write(b"still here")
        await asyncio.sleep(0.1)
        client.close()
    assert client.bytes == b"still here"
    # Once every 100 ms, and once more for what was received.
    assert len(calls) < 30


async def test_is_raw_from_the_start_so_that_every_byte_passes():
    async with Line([Echo()]) as line:
        client = Client(line.path)
        iflag, oflag, _, lflag, *_ = termios.tcgetattr(client.fd)
        assert not lflag & (termios.ECHO | termios.ICANON | termios.ISIG)
        assert not iflag & (termios.IXON | termios.ICRNL | termios.ISTRIP)
        assert not oflag & termios.OPOST
        client.write(bytes(range(256)))
        await asyncio.sleep(1.0)
        client.close()
    assert client.bytes == bytes(range(256))


async def test_several_clients_come_one_after_the_other():
    async with Line([Echo()]) as line:
        for text in (b"first", b"second", b"third"):
            client = Client(line.path)
            client.write(text)
            await asyncio.sleep(0.1)
            client.close()
            await asyncio.sleep(0.5)
            assert client.bytes == text


async def test_a_client_that_stops_reading_loses_bytes_but_stops_nobody():
    echo = Echo()
    async with Line([echo], 4_000_000) as line:
        client = Client(line.path)
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


async def test_a_client_that_floods_is_slowed_down_and_every_byte_arrives_once():
    echo = Echo()
    echo.answer = False
    flood = bytes(n % 255 + 1 for n in range(60_000))
    async with Line([echo]) as line:
        client = Client(line.path)
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


async def test_a_pulled_cable_hangs_up_and_a_new_one_is_found_at_the_same_path(tmp_path):
    echo = Echo()
    async with Line([echo], link=tmp_path / "port") as line:
        client = Client(line.path)
        client.write(b"lost on the way")
        await asyncio.sleep(0.0001)
        line.unplug()
        await asyncio.sleep(0.1)
        assert not client.open
        assert os.listdir(tmp_path) == []
        echo.send(b"into the air", 0.1)
        assert echo.heard == []
        line.plug()
        client = Client(line.path)
        client.write(b"back")
        await asyncio.sleep(0.1)
        client.close()
        assert client.bytes == b"back"
    assert os.listdir(tmp_path) == []


async def test_a_hang_up_ends_after_its_time(tmp_path):
    async with Line([Echo()], link=tmp_path / "port") as line:
        line.hang_up(2.0)
        await asyncio.sleep(1.99)
        assert not line.plugged
        await asyncio.sleep(0.02)
        assert line.plugged


async def test_a_stall_lets_nothing_onto_the_line_for_its_time():
    async with Line([Echo()]) as line:
        client = Client(line.path)
        line.stall(0.3)
        client.write(b"late")
        await asyncio.sleep(1.0)
        client.close()
    assert client.got == [(pytest.approx(0.3 + 8 * BYTE), b"late")]


async def test_a_file_in_the_place_of_the_link_is_not_touched(tmp_path):
    (tmp_path / "port").write_text("somebody's")
    line = Line([Echo()], link=tmp_path / "port")
    with pytest.raises(FileExistsError):
        await line.start()
    await line.stop()
    assert (tmp_path / "port").read_text() == "somebody's"


async def test_a_stale_link_is_replaced(tmp_path):
    (tmp_path / "port").symlink_to("/dev/pts/nowhere")
    async with Line([Echo()], link=tmp_path / "port") as line:
        Client(line.path).close()


async def run_over_faults(plan: FaultPlan | None, frames: int = 200, gap: float = 0.01):
    """Send numbered frames through a faulty wire; return what arrived, when, and what came back."""
    echo = Echo()
    async with Line([echo], faults=plan) as line:
        client = Client(line.path)
        for n in range(frames):
            client.write(bytes((n,)) * 8)
            await asyncio.sleep(gap)
        await asyncio.sleep(5.0)
        client.close()
    return echo.heard, client.got


def test_the_same_seed_gives_the_same_bytes_at_the_same_times():
    plan = FaultPlan(seed=3, drop=0.1, flip=0.1, insert=0.1, double=0.1, split=0.1, delay=0.1, stall=0.02)
    first, second = run_virtual(run_over_faults(plan)), run_virtual(run_over_faults(plan))
    assert first == second
    assert first != run_virtual(run_over_faults(FaultPlan(seed=4, drop=0.1, flip=0.1)))


async def test_dropped_frames_are_gone_and_the_others_are_whole_and_in_order():
    heard, _ = await run_over_faults(FaultPlan(seed=1, drop=0.2, direction="to_device"))
    numbers = [data[0] for _, data in heard]
    assert all(data == data[:1] * 8 for _, data in heard)
    assert numbers == sorted(numbers)
    # 200 tries at 0.2: 40 ± 5.7, six standard deviations either way.
    assert 6 < 200 - len(numbers) < 75


async def test_flipped_frames_keep_their_length_and_differ_in_one_to_three_bits():
    heard, _ = await run_over_faults(FaultPlan(seed=1, flip=1.0, direction="to_device"), frames=100)
    for n, (_, data) in enumerate(heard):
        wrong = int.from_bytes(data, "big") ^ int.from_bytes(bytes((n,)) * 8, "big")
        assert len(data) == 8
        assert wrong.bit_count() <= 3
    assert len(heard) == 100


async def test_inserted_bytes_take_their_time_on_the_wire():
    heard, _ = await run_over_faults(FaultPlan(seed=1, insert=1.0, direction="to_device"), frames=1)
    ((t, data),) = heard
    assert len(data) == 9
    assert t == pytest.approx(9 * BYTE)


async def test_a_double_follows_its_original_directly():
    heard, _ = await run_over_faults(FaultPlan(seed=1, double=1.0, direction="to_device"), frames=20)
    assert [data[0] for _, data in heard] == [n for n in range(20) for _ in "ab"]
    assert heard[1][0] - heard[0][0] == pytest.approx(8 * BYTE)


async def test_split_frames_come_in_two_pieces_with_a_gap():
    heard, _ = await run_over_faults(
        FaultPlan(seed=1, split=1.0, split_s=0.004, direction="to_device"), frames=20
    )
    assert len(heard) == 40
    assert b"".join(data for _, data in heard) == b"".join(bytes((n,)) * 8 for n in range(20))
    gaps = [heard[n + 1][0] - heard[n][0] - len(heard[n + 1][1]) * BYTE for n in range(0, len(heard), 2)]
    assert max(gaps) > 0.001
    assert all(-1e-9 < gap <= 0.004 + 1e-9 for gap in gaps)


async def test_delayed_frames_keep_their_order():
    heard, _ = await run_over_faults(
        FaultPlan(seed=1, delay=0.3, delay_s=0.3, direction="to_device"), frames=100, gap=0.05
    )
    assert [data[0] for _, data in heard] == list(range(100))
    late = [t - 0.05 * n - 8 * BYTE for n, (t, _) in enumerate(heard)]
    assert min(late) == pytest.approx(0, abs=1e-9)
    assert max(late) > 0.1


async def test_only_the_planned_direction_and_time_are_faulty():
    heard, got = await run_over_faults(
        FaultPlan(seed=1, drop=1.0, direction="to_host", start_s=1.0, end_s=1.5)
    )
    assert [data[0] for _, data in heard] == list(range(200))
    back = {data[0] for _, data in got}
    assert back == set(range(100)) | set(range(150, 200))


async def test_a_planned_hang_up_pulls_the_cable(tmp_path):
    async with Line([Echo()], faults=FaultPlan(seed=1, hang_up=1.0), link=tmp_path / "port") as line:
        client = Client(line.path)
        client.write(b"the last words")
        await asyncio.sleep(0.5)
        assert not client.open
        assert not line.plugged
        await asyncio.sleep(0.6)
        assert line.plugged


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"drop": 1.5}, "drop is 1.5, must be a probability"),
        ({"delay_s": -1.0}, "delay_s is -1.0, must be 0 s or more"),
        ({"direction": "up"}, "direction is 'up', must be one of"),
    ],
)
def test_an_impossible_plan_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        FaultPlan(**wrong)


def test_two_runs_of_a_session_are_alike_to_the_byte(hand):
    async def session():
        device = LinkDevice(0x21, type(hand.lamp)(), boot_count=3)
        async with Line([device], faults=FaultPlan(seed=8, drop=0.1, flip=0.05, split=0.2)) as line:
            client = Client(line.path)
            client.write(encode_frame(0x21, 0, 0, HELLO, 15, b"ab"))
            for n in range(1, 100):
                await asyncio.sleep(0.013)
                client.write(encode_frame(0x21, 0, n % 64, PING, 15))
            await asyncio.sleep(1.0)
            client.close()
        return client.got

    first = run_virtual(session())
    assert first == run_virtual(session())
    replies = [m for m in FrameReceiver().feed(b"".join(data for _, data in first)) if isinstance(m, tuple)]
    assert 50 < len(replies) < 100
    assert all(message.kind == Kind.REPLY for message in replies)


@pytest.mark.real_time
async def test_without_a_client_nothing_is_busy():
    async with Line([Echo()]) as line:
        client = Client(line.path)
        client.write(b"here and gone")
        client.close()
        before = resource.getrusage(resource.RUSAGE_SELF)
        await asyncio.sleep(0.5)
        after = resource.getrusage(resource.RUSAGE_SELF)
    used = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    # A loop that spins takes all of the half second; this one wakes a few times.
    assert used < 0.25


@pytest.mark.real_time
async def test_a_line_serves_on_the_wall_clock_too():
    async with Line([Echo()]) as line:
        client = Client(line.path)
        tty.setraw(client.fd)
        client.write(b"real")
        for _ in range(1000):
            if client.bytes == b"real":
                break
            await asyncio.sleep(0.01)
        client.close()
    assert client.bytes == b"real"
