"""Request and reply over an unpaced pty, two processes: the session beside bare descriptors and libraries.

    tools/bench link [--seconds S] [--rounds N] [--free] [--json FILE]

Every path asks with 10 bytes and is answered with 10 by the same process; every one but the first has a deadline
on each request. The libraries run twice: as they are, handing over bytes, and framed: with this project's codec
and a check of the sequence number, which is what a driver needs of them and what the session always does. Rounds
are interleaved; p50 and processor time are those of each path's quietest round, for other load only adds.

Both processes share one processor, so that a round trip is the work of both sides: waking another processor of a
virtual machine takes anything from 5 to 100 µs, the same for all paths, and hides what is compared (--free lets it).
The processor time is the asking process's, kernel included. A library that is not installed is skipped.
"""

import argparse
import asyncio
import contextlib
import json
import multiprocessing
import os
import pty
import select
import statistics
import sys
import tty
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from time import perf_counter, thread_time

from cobs import cobs

from medusa.link import Line, Operation
from medusa.link.frame import REPLY, REQUEST, Message, decode_body, encode_frame
from medusa.link.messages import HELLO

DEADLINE = 0.1
READ, PAYLOAD = Operation(0x10, "READ", reply=None, reads=True), b"\x0d\x01"
OURS = "medusa.link"
GOALS = {"bare add_reader": 0.6, "pyserial-asyncio-fast, framed": 1.3, "serialx, framed": 1.3}
Ask = Callable[[], Awaitable[object]]


def replies() -> dict[bytes, bytes]:
    """Return the answer to each of the 64 requests there are, all of 10 bytes."""
    return {
        encode_frame(Message(1, REQUEST, n, READ.code, 0, PAYLOAD)): encode_frame(
            Message(1, REPLY, n, READ.code, 0, PAYLOAD)
        )
        for n in range(64)
    }


def answer_for_ever(fd: int) -> None:
    """Answer each frame on the master's side; HELLO with its own nonce."""
    known = replies()
    buffer = b""
    while True:
        buffer += os.read(fd, 4096)
        *frames, buffer = buffer.split(b"\0")
        for frame in frames:
            answer = known.get(frame + b"\0")
            if answer is None:
                body = cobs.decode(frame)
                if body[2] == HELLO.code:
                    nonce = body[4:6] + bytes.fromhex("0101020107 00".replace(" ", "")) + bytes(1)
                    answer = encode_frame(Message(1, REPLY, body[1] & 63, HELLO.code, 0, nonce))
            if answer is not None:
                os.write(fd, answer)


@asynccontextmanager
async def raw(path: str) -> AsyncIterator[Ask]:
    """Blocking reads and writes on the descriptor; no deadline, no event loop."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY)
    request = next(iter(replies()))

    async def ask() -> bytes:
        os.write(fd, request)
        got = os.read(fd, 64)
        while len(got) < len(request):
            got += os.read(fd, 64)
        return got

    try:
        yield ask
    finally:
        os.close(fd)


@asynccontextmanager
async def bare(path: str) -> AsyncIterator[Ask]:
    """add_reader on the descriptor, one future and one timer a request, no codec."""
    fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    request = next(iter(replies()))
    loop = asyncio.get_running_loop()
    waiting: list[asyncio.Future[bytes]] = []
    got = bytearray()

    def readable() -> None:
        got.extend(os.read(fd, 4096))
        if len(got) >= len(request):
            waiting.pop().set_result(bytes(got))
            got.clear()

    def expire() -> None:
        waiting.pop().set_exception(TimeoutError())

    async def ask() -> object:
        future = loop.create_future()
        waiting.append(future)
        timer = loop.call_later(DEADLINE, expire)
        os.write(fd, request)
        try:
            return await future
        finally:
            timer.cancel()

    loop.add_reader(fd, readable)
    try:
        yield ask
    finally:
        loop.remove_reader(fd)
        os.close(fd)


def through_streams(
    module: str, framed: bool
) -> Callable[[str], contextlib.AbstractAsyncContextManager[Ask]]:
    """Return the path through a library's asyncio streams."""

    @asynccontextmanager
    async def streams(path: str) -> AsyncIterator[Ask]:
        library = __import__(module)
        reader, writer = await library.open_serial_connection(url=path, baudrate=115200)
        request = next(iter(replies()))
        number = 0

        async def ask_bytes() -> object:
            writer.write(request)
            async with asyncio.timeout(DEADLINE):
                return await reader.readexactly(len(request))

        async def ask_framed() -> object:
            nonlocal number
            number = (number + 1) % 64
            writer.write(encode_frame(Message(1, REQUEST, number, READ.code, 0, PAYLOAD)))
            async with asyncio.timeout(DEADLINE):
                while True:
                    item = decode_body((await reader.readuntil(b"\0"))[:-1])
                    if isinstance(item, Message) and item.sequence == number and item.kind == REPLY:
                        return item.payload

        try:
            yield ask_framed if framed else ask_bytes
        finally:
            writer.close()
            with contextlib.suppress(Exception):
                await writer.wait_closed()

    return streams


@asynccontextmanager
async def session(path: str) -> AsyncIterator[Ask]:
    """The session: codec, window, sequence numbers, deadline and repeats."""
    async with Line(path, reply_timeout=DEADLINE) as line:
        ours = line.session(1)
        await ours.open()
        yield lambda: ours.request(READ, 0, PAYLOAD)


PATHS: dict[str, Callable[[str], contextlib.AbstractAsyncContextManager[Ask]]] = {
    "raw descriptors": raw,
    "bare add_reader": bare,
    "pyserial-asyncio-fast": through_streams("serial_asyncio_fast", framed=False),
    "serialx": through_streams("serialx", framed=False),
    "pyserial-asyncio-fast, framed": through_streams("serial_asyncio_fast", framed=True),
    "serialx, framed": through_streams("serialx", framed=True),
    OURS: session,
}


async def measure(
    path: str, through: Callable[[str], contextlib.AbstractAsyncContextManager[Ask]], seconds: float
) -> tuple[list[float], float]:
    """Return how long each request took, and the processor time spent on one, in seconds."""
    async with through(path) as ask:
        for _ in range(200):
            await ask()
        times = []
        used = thread_time()
        end = perf_counter() + seconds
        before = perf_counter()
        while before < end:
            await ask()
            now = perf_counter()
            times.append(now - before)
            before = now
        return times, (thread_time() - used) / len(times)


async def longest_turn(master: int, path: str) -> float:
    """Return the longest turn of the loop in processor seconds: garbage floods in, the peer reads nothing."""
    os.set_blocking(master, False)
    longest, sent, before = 0.0, 0, thread_time()
    async with Line(path, reply_timeout=DEADLINE) as line:
        asked = [asyncio.ensure_future(line.session(n).open()) for n in range(1, 40)]
        while sent < 2_000_000:
            await asyncio.sleep(0)
            now = thread_time()
            longest = max(longest, now - before)
            # What the flood itself costs is not the loop's.
            with contextlib.suppress(BlockingIOError):
                sent += os.write(master, os.urandom(4096))
            before = thread_time()
        for answer in asked:
            answer.cancel()
        await asyncio.gather(*asked, return_exceptions=True)
    return longest


def main(argv: list[str]) -> int:
    """Run the comparison and print it; returns 1 when a ratio misses its goal."""
    arguments = argparse.ArgumentParser(
        prog="tools/bench link", description=__doc__.split("\n")[0] if __doc__ else ""
    )
    arguments.add_argument("--seconds", type=float, default=0.1, help="for each path in each round")
    arguments.add_argument("--rounds", type=int, default=40)
    arguments.add_argument("--free", action="store_true", help="let the processes run on any processor")
    arguments.add_argument("--json", help="write the figures to this file, too")
    options = arguments.parse_args(argv)
    if not options.free:
        os.sched_setaffinity(0, {max(os.sched_getaffinity(0))})

    master, slave = pty.openpty()
    tty.setraw(slave)
    path = os.ttyname(slave)
    responder = multiprocessing.get_context("fork").Process(
        target=answer_for_ever, args=(master,), daemon=True
    )
    responder.start()
    present = {}
    for name, through in PATHS.items():
        try:
            asyncio.run(measure(path, through, 0.01))
        except ImportError:
            print(f"{name}: not installed, skipped (pip install 'medusa-head[bench]')", file=sys.stderr)
            continue
        present[name] = through
    rates: dict[str, list[float]] = {name: [] for name in present}
    halves: dict[str, list[float]] = {name: [] for name in present}
    processor: dict[str, list[float]] = {name: [] for name in present}
    for _ in range(options.rounds):
        for name, through in present.items():
            drain(slave)
            times, used = asyncio.run(measure(path, through, options.seconds))
            rates[name].append(len(times) / sum(times))
            halves[name].append(statistics.median(times) * 1e6)
            processor[name].append(used * 1e6)
    responder.terminate()
    responder.join()
    turn = asyncio.run(longest_turn(master, path))
    print(f"longest turn of the loop, garbage flooding in, nobody reading: {turn * 1e3:.1f} ms (20 allowed)")
    return report(rates, halves, processor, options.json)


def drain(fd: int) -> None:
    """Throw away what a path left unread."""
    while select.select([fd], [], [], 0.05)[0]:
        os.read(fd, 4096)


def report(
    rates: dict[str, list[float]],
    halves: dict[str, list[float]],
    processor: dict[str, list[float]],
    file: str | None,
) -> int:
    """Print what each path took, and how it compares with ours."""
    rate = {name: statistics.median(values) for name, values in rates.items()}
    p50 = {name: min(values) for name, values in halves.items()}
    used = {name: min(values) for name, values in processor.items()}
    ratio = {name: value / p50[OURS] for name, value in p50.items()}
    by_processor = {name: value / used[OURS] for name, value in used.items()}
    print(
        f"{'path':32}{'requests/s':>11}{'best round':>12}{'p50 µs':>9}{'CPU µs':>9}{'ours/this':>11}{'by CPU':>9}"
    )
    for name in rates:
        print(
            f"{name:32}{rate[name]:11.0f}{max(rates[name]):12.0f}{p50[name]:9.1f}{used[name]:9.1f}"
            f"{ratio[name]:11.2f}{by_processor[name]:9.2f}"
        )
    missed = [name for name, goal in GOALS.items() if name in ratio and ratio[name] < goal]
    for name in missed:
        print(f"goal missed: {ratio[name]:.2f} of {name}, {GOALS[name]} wanted")
    if file:
        figures = {
            "requests_per_second": rate,
            "p50_us": p50,
            "processor_us": used,
            "ours_over_this": ratio,
            "ours_over_this_by_processor": by_processor,
        }
        with open(file, "w", encoding="utf-8") as out:
            json.dump(figures, out, indent=1)
    return 1 if missed else 0
