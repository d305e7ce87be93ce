"""Whatever is written to the ports: no device fails, none is lost, and the state can be told."""

import asyncio
import contextlib
import json
import os
import random

import pytest

from sim_devices.bench import Bench
from sim_devices.head import HeadMachine
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.link.frame import FrameReceiver, encode_frame

ADDRESSES = {"mc3000": (1, 2), "labmate": (0x10,)}
OPERATIONS = [*range(8), *range(0x10, 0x23), *range(0x30, 0x39)]


def noise(source, addresses):
    """Return garbage, a HELLO, or a frame that is well formed and otherwise random."""
    kind = source.random()
    if kind < 0.3 or not addresses:
        return source.randbytes(source.randint(1, 40))
    if kind < 0.4:
        return encode_frame(source.choice(addresses), 0, source.randrange(64), 1, 15, b"ab")
    payload = source.randbytes(source.choice((0, 1, 2, 3, 4, 6, 8, 9, 12)))
    return encode_frame(
        source.choice((0, *addresses)),
        source.choice((0, 0, 0, 0, 1, 2, 3)),
        source.randrange(64),
        source.choice(OPERATIONS),
        source.choice((0, 1, 2, 15, 15)),
        payload,
    )


@pytest.mark.parametrize("seed", range(3))
async def test_noise_on_every_port_breaks_nothing(seed, caplog):
    source = random.Random(seed)
    parts = {
        "head": HeadMachine(seed=seed),
        "base": BaseMachine(BaseConfig(walls=[(0.5, -1.0, 0.5, 1.0)], boxes=[]), seed),
    }
    async with Bench(parts, seed=seed) as bench:
        ends = {
            name: os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK) for name, path in bench.ports.items()
        }
        heard = 0
        for _ in range(500):
            for name, end in ends.items():
                os.write(end, noise(source, ADDRESSES.get(name, ())))
            await asyncio.sleep(0.02)
            for end in ends.values():
                with contextlib.suppress(BlockingIOError):
                    heard += len(os.read(end, 65536))
        json.dumps(bench.state(), allow_nan=False)
        for name, addresses in ADDRESSES.items():
            for address in addresses:
                os.write(ends[name], b"\0" + encode_frame(address, 0, 9, 1, 15, b"zz"))
                await asyncio.sleep(0.05)
                answers = FrameReceiver().feed(os.read(ends[name], 65536))
                assert any(m.address == address and m.payload[:2] == b"zz" for m in answers)
        for end in ends.values():
            os.close(end)
    assert heard > 1000
    assert [record for record in caplog.records if record.levelname == "ERROR"] == []
