"""Bases on the bench: lines, several at once, the same bytes for the same seed."""

import asyncio
import os
import struct

from sim_devices.bench import Bench
from sim_devices.clock import run_virtual
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame

HELLO, GO, POSE = 1, 0x33, 0x30


class Host:
    """Asks one question after the other at a port."""

    def __init__(self, path):
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        self.receiver = FrameReceiver()
        self.answers = asyncio.Queue()
        self.heard = b""
        self.sequence = 0
        asyncio.get_running_loop().add_reader(self.fd, self._readable)

    def _readable(self):
        data = os.read(self.fd, 4096)
        self.heard += data
        for message in self.receiver.feed(data):
            if message.kind == Kind.REPLY:
                self.answers.put_nowait(message)

    async def ask(self, address, operation, payload=b""):
        self.sequence = (self.sequence + 1) % 64
        os.write(self.fd, encode_frame(address, 0, self.sequence, operation, 15, payload))
        async with asyncio.timeout(1.0):
            return await self.answers.get()

    def close(self):
        asyncio.get_running_loop().remove_reader(self.fd)
        os.close(self.fd)


async def test_two_bases_share_a_line_and_move_each_for_itself():
    first, second = BaseMachine(BaseConfig(), 1), BaseMachine(BaseConfig(address=0x11, start_y=3.0), 1)
    async with Bench({"base": first, "base2": second}) as bench:
        assert list(bench.ports) == ["labmate"]
        host = Host(bench.ports["labmate"])
        for address in (0x10, 0x11):
            assert (await host.ask(address, HELLO, b"ab")).address == address
        await host.ask(0x11, GO, struct.pack("<i", 5000))
        await asyncio.sleep(5.0)
        host.close()
        state = bench.state()
    assert state["base"]["odometry"]["x"] == 0
    assert abs(state["base2"]["odometry"]["x"] - 0.5) < 1e-3
    assert abs(state["base2"]["pose"]["y"] - 3.0) < 1e-2


async def test_bases_on_lines_of_their_own_may_have_the_same_address():
    bases = {name: BaseMachine(BaseConfig(line=name), 1) for name in ("north", "south")}
    async with Bench(bases) as bench:
        assert list(bench.ports) == ["north", "south"]
        for path in bench.ports.values():
            host = Host(path)
            assert (await host.ask(0x10, HELLO, b"ab")).axis == 0
            host.close()


async def test_an_event_of_the_button_comes_without_any_request():
    base = BaseMachine(seed=1)
    async with Bench({"base": base}) as bench:
        host = Host(bench.ports["labmate"])
        await host.ask(0x10, HELLO, b"ab")
        await host.ask(0x10, 0x07, b"\xff\xff\xff\xff")
        host.heard = b""
        bench.inject("base.press_emergency_stop")
        await asyncio.sleep(0.01)
        (event,) = FrameReceiver().feed(host.heard)
        assert (event.kind, event.operation) == (Kind.EVENT, 0x43)
        host.close()


async def test_the_power_up_is_the_benchs_start_not_the_clocks():
    await asyncio.sleep(100.0)
    base = BaseMachine(seed=1)
    async with Bench({"base": base}) as bench:
        host = Host(bench.ports["labmate"])
        await host.ask(0x10, HELLO, b"ab")
        await asyncio.sleep(1.0)
        (time_us,) = struct.unpack_from("<I", (await host.ask(0x10, POSE)).payload)
        host.close()
    assert 1_000_000 < time_us < 1_010_000


async def test_the_state_is_json():
    import json

    base = BaseMachine(BaseConfig(walls=[(1, -1, 1, 1)]), 1)
    async with Bench({"base": base}) as bench:
        text = json.dumps(bench.state(), allow_nan=False)
    assert '"bumpers": []' in text


def test_two_runs_are_alike_to_the_byte():
    async def run():
        async with Bench({"base": BaseMachine(seed=9)}, seed=9) as bench:
            host = Host(bench.ports["labmate"])
            await host.ask(0x10, HELLO, b"ab")
            await host.ask(0x10, 0x07, b"\xff\xff\xff\xff")
            await host.ask(0x10, GO, struct.pack("<i", 3000))
            for _ in range(50):
                await asyncio.sleep(0.05)
                await host.ask(0x10, POSE)
            host.close()
            return host.heard

    first = run_virtual(run())
    assert first == run_virtual(run())
    assert len(first) > 1000
