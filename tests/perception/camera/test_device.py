"""A live camera against a server on the loopback: opened, lost, stalled, changed, and opened again."""

import asyncio
import os
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import numpy as np
import pytest

from perception.camera.device import CaptureSettings, DeviceCamera, open_camera
from perception.camera.errors import CameraError, CameraLost, CameraNotFound, CameraStalled, SettingRefused
from perception.camera.frame import Frame
from perception.camera.source import Source

pytestmark = pytest.mark.real_time
PATIENCE = 20.0


class Server:
    """A y4m stream of the test's own: each image is one grey level, counting up."""

    def __init__(self) -> None:
        self.size = (32, 24)
        self.silent = False
        self.port = 0
        self._server: asyncio.Server | None = None
        self._writers: set[asyncio.StreamWriter] = set()

    async def start(self) -> None:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self.port)
        self.port = self._server.sockets[0].getsockname()[1]

    def stop(self) -> None:
        if self._server is not None:
            self._server.close()
        for writer in self._writers:
            writer.transport.abort()

    @property
    def url(self) -> str:
        return f"tcp://127.0.0.1:{self.port}"

    async def _serve(self, _reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._writers.add(writer)
        width, height = self.size
        writer.write(f"YUV4MPEG2 W{width} H{height} F50:1 Ip A1:1 Cmono\n".encode())
        try:
            for k in range(100_000):
                if not self.silent:
                    writer.write(b"FRAME\n" + bytes([k % 200 + 20]) * (width * height))
                await writer.drain()
                await asyncio.sleep(0.02)
        except ConnectionError:
            pass
        finally:
            self._writers.discard(writer)
            writer.close()


@asynccontextmanager
async def serving() -> AsyncIterator[Server]:
    server = Server()
    await server.start()
    try:
        yield server
    finally:
        server.stop()


async def take(camera: DeviceCamera, count: int) -> list[Frame]:
    taken: list[Frame] = []
    async with asyncio.timeout(PATIENCE):
        async for frame in camera.frames():
            taken.append(frame)
            if len(taken) == count:
                return taken
    return taken


def live(server: Server, stall_after: float = 2.0) -> DeviceCamera:
    return DeviceCamera(Source("address", server.url), name="left", stall_after=stall_after)


async def test_a_live_camera_gives_grey_frames_stamped_on_the_loops_clock() -> None:
    async with serving() as server, live(server) as camera:
        frames = await take(camera, 10)
        now = asyncio.get_running_loop().time()
        assert all(frame.size == (32, 24) and frame.image.ndim == 2 for frame in frames)
        assert [f.sequence for f in frames] == sorted({f.sequence for f in frames})
        stamps = [frame.stamp for frame in frames]
        assert stamps == sorted(stamps)
        assert 0.0 <= now - stamps[-1] < PATIENCE
        levels = np.array([int(f.image[0, 0]) for f in frames])
        assert (np.diff(levels) > 0).all()


async def test_frames_that_the_loop_was_too_slow_for_are_counted() -> None:
    async with serving() as server, live(server) as camera:
        await take(camera, 2)
        await asyncio.sleep(0.5)  # 25 images that nobody takes
        await take(camera, 1)
        assert camera.statistics.dropped >= 5


async def test_a_camera_that_vanishes_is_lost_and_comes_back() -> None:
    async with serving() as server, live(server) as camera:
        await take(camera, 3)
        server.stop()
        with pytest.raises(CameraError) as caught:
            await take(camera, 10_000)
        assert isinstance(caught.value, CameraLost | CameraStalled)
        with pytest.raises(CameraError):
            camera.latest()
        await server.start()
        await come_back(camera)
        assert camera.statistics.reopened >= 1


async def test_a_camera_that_says_nothing_is_stalled() -> None:
    async with serving() as server, live(server, stall_after=0.6) as camera:
        await take(camera, 3)
        server.silent = True
        with pytest.raises((CameraStalled, CameraLost), match="left"):
            await take(camera, 10_000)
        server.silent = False
        await come_back(camera)


async def test_a_camera_whose_driver_crashes_is_lost_and_comes_back() -> None:
    async with serving() as server, live(server) as camera:
        await take(camera, 3)
        for process in capture_processes():
            os.kill(process, signal.SIGSEGV)
        with pytest.raises(CameraLost, match="left"):
            await take(camera, 10_000)
        await come_back(camera)
    assert capture_processes() == []


async def test_a_camera_closed_by_two_cancellations_leaves_no_process() -> None:
    async with serving() as server:
        camera = live(server)
        await camera.open()
        closing = asyncio.create_task(camera.close())
        await asyncio.sleep(0)
        closing.cancel()
        with pytest.raises(asyncio.CancelledError):
            await closing
        await camera.close()
    assert capture_processes() == []


async def test_an_address_nobody_answers_at_is_not_found() -> None:
    server = Server()
    await server.start()
    server.stop()
    with pytest.raises(CameraNotFound, match="cannot be opened"):
        async with live(server):
            pass


async def test_a_size_the_camera_cannot_give_is_refused() -> None:
    async with serving() as server:
        camera = open_camera(server.url, CaptureSettings(width=4000), name="left")
        with pytest.raises(SettingRefused, match=r"width 4000.*32"):
            await camera.open()


async def come_back(camera: DeviceCamera) -> None:
    async with asyncio.timeout(PATIENCE):
        while True:
            try:
                await take(camera, 2)
            except CameraError:
                await asyncio.sleep(0.1)
            else:
                return


def capture_processes() -> list[int]:
    """The processes that this one has started and that still run."""
    found = []
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = stat.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if int(parent) == os.getpid() and state != "Z":
            found.append(int(stat.parent.name))
    return found
