"""A program that closes its camera, or forgets to, ends with 0: whatever the stream or the driver does meanwhile.

Two runs of each in the suite; CAMERA_RUNS=50 makes it fifty.
"""

import json
import os
import socketserver
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import cv2
import numpy as np
import pytest

pytestmark = pytest.mark.real_time
RUNS = int(os.environ.get("CAMERA_RUNS", "2"))
DEADLINE_S = 60
JPEG = cv2.imencode(".jpg", np.full((48, 64), 100, np.uint8))[1].tobytes()
PART = b"--frame\r\nContent-Type: image/jpeg\r\nContent-Length: %d\r\n\r\n" % len(JPEG) + JPEG + b"\r\n"
Y4M = b"YUV4MPEG2 W32 H24 F50:1 Ip A1:1 Cmono\n"

CLIENT = """
import asyncio, json, os, sys, threading
from pathlib import Path
from perception.camera.device import DeviceCamera
from perception.camera.errors import CameraError
from perception.camera.source import Source

place, frames, wait_s, close = json.loads(sys.argv[1])
left_open = []

async def main():
    camera = DeviceCamera(Source("address", place), name="left", stall_after=1.0)
    taken = 0
    try:
        await camera.open()
        async with asyncio.timeout(20):
            async for frame in camera.frames():
                taken += 1
                if taken == frames:
                    break
    except CameraError as error:
        print(error, file=sys.stderr)
    await asyncio.sleep(wait_s)
    if close:
        await camera.close()
    else:
        left_open.append(camera)
    return taken, [thread.name for thread in threading.enumerate() if "camera" in thread.name]

def children():
    for stat in Path("/proc").glob("[0-9]*/stat"):
        try:
            fields = stat.read_text().rpartition(")")[2].split()
        except OSError:
            continue
        if int(fields[1]) == os.getpid():
            yield stat.parent.name

taken, threads = asyncio.run(main())
print(json.dumps([taken, threads, list(children()) if close else []]))
"""


class Stream(socketserver.BaseRequestHandler):
    """Motion JPEG over HTTP at 50 Hz; after `frames` of them the server keeps the connection and sends nothing."""

    frames = 1_000_000

    def handle(self) -> None:
        self.request.recv(4096)
        with suppress(OSError):
            if self.frames:
                self.request.sendall(
                    b"HTTP/1.0 200 OK\r\nContent-Type: multipart/x-mixed-replace; boundary=frame\r\n\r\n"
                )
            for _ in range(self.frames):
                self.request.sendall(PART)
                time.sleep(0.02)
            while self.request.recv(4096):
                pass


@contextmanager
def streaming(frames: int = 1_000_000) -> Iterator[str]:
    handler = type("Limited", (Stream,), {"frames": frames})
    with socketserver.ThreadingTCPServer(("127.0.0.1", 0), handler) as server:
        server.daemon_threads = True
        threading.Thread(target=server.serve_forever, args=(0.02,), daemon=True).start()
        try:
            yield f"http://127.0.0.1:{server.server_address[1]}/"
        finally:
            server.shutdown()


def run_client(place: str, frames: int = 3, wait_s: float = 0.0, close: bool = True) -> int:
    """Take frames, close, end; the number of frames. A camera thread or process that is left fails the test."""
    words = [sys.executable, "-c", CLIENT, json.dumps([place, frames, wait_s, close])]
    ended = subprocess.run(words, capture_output=True, text=True, timeout=DEADLINE_S, check=False)
    assert ended.returncode == 0, ended.stderr
    assert "terminate" not in ended.stderr
    taken, threads, children = json.loads(ended.stdout)
    assert threads == []
    assert children == []
    return int(taken)


@pytest.mark.parametrize("run", range(RUNS))
def test_a_program_that_closes_a_stream_ends_with_0(run: int) -> None:
    with streaming() as url:
        assert run_client(url) == 3


@pytest.mark.parametrize("run", range(RUNS))
def test_a_program_that_ends_without_closing_ends_with_0(run: int) -> None:
    with streaming() as url:
        assert run_client(url, close=False) == 3


@pytest.mark.parametrize("run", range(RUNS))
def test_a_program_that_closes_a_stream_that_hangs_ends_with_0(run: int) -> None:
    with streaming(frames=5) as url:
        # Closed at any moment of the hang, of its time-out and of opening again after it.
        assert run_client(url, frames=1, wait_s=0.6 * (run % 5)) == 1


def test_a_program_whose_server_accepts_and_never_answers_ends_with_0() -> None:
    with streaming(frames=0) as url:
        assert run_client(url) == 0


@pytest.mark.parametrize("close", [True, False])
def test_a_driver_that_hangs_in_a_system_call_does_not_keep_the_program(tmp_path: Path, close: bool) -> None:
    """A named pipe stands for it: no time-out of OpenCV or FFmpeg interrupts its read."""
    pipe = tmp_path / "video.y4m"
    os.mkfifo(pipe)
    release = threading.Event()

    def write() -> None:
        with suppress(OSError), pipe.open("wb") as video:
            video.write(Y4M + (b"FRAME\n" + bytes(32 * 24)) * 200)
            video.flush()
            release.wait(DEADLINE_S)

    writer = threading.Thread(target=write, daemon=True)
    writer.start()
    try:
        assert run_client(str(pipe), frames=1, wait_s=0.5, close=close) == 1
    finally:
        release.set()
        writer.join()
