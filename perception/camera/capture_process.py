"""A capture process as its parent sees it: started, its frames received by the event loop, ended whatever it does."""

import asyncio
import os
import socket
import subprocess
import sys
from contextlib import suppress
from typing import Self

import msgspec
import numpy as np

from perception.camera import errors
from perception.camera.capture_messages import (
    LENGTH,
    CaptureRequest,
    FrameHeader,
    Message,
    NotOpened,
    decode_message,
)
from perception.camera.errors import CameraError, CameraLost, CameraNotFound
from perception.camera.frame import Frame

BUFFER_BYTES = 1 << 20
"""Asked of the socket, so that a frame takes few turns of the loop; the system may give less."""
END_S, KILL_S, POLL_S = 1.0, 0.2, 0.005
"""How long the process may take to end by itself and then to be killed, and how often it is looked at meanwhile."""


class CaptureProcess:
    """One opened camera in a process of its own."""

    def __init__(
        self, request: CaptureRequest, process: subprocess.Popen[bytes], link: socket.socket
    ) -> None:
        self._request, self._process, self._link = request, process, link

    @classmethod
    def start(cls, request: CaptureRequest) -> Self:
        """Start the process, which begins to open the camera.

        Raises:
            CameraNotFound: the process cannot be started.
        """
        mine, its = socket.socketpair()
        its.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        mine.setblocking(False)
        # -P and our own path: it imports what we import, whatever lies in the working directory.
        command = [sys.executable, "-P", "-m", "perception.camera.capture"]
        command.append(msgspec.json.encode(request).decode())
        path = os.pathsep.join(os.path.abspath(folder) for folder in sys.path)
        try:
            with its:
                # A session of its own: Ctrl-C and a closed terminal are for us, who stop the machine first.
                process = subprocess.Popen(
                    command,
                    stdin=its.fileno(),
                    stdout=subprocess.DEVNULL,
                    env={**os.environ, "PYTHONPATH": path},
                    start_new_session=True,
                )
        except OSError as error:
            mine.close()
            raise CameraNotFound(
                f"camera {request.name}: its capture process cannot be started ({error.strerror or error})"
            ) from error
        return cls(request, process, mine)

    async def opened(self) -> None:
        """Wait until the camera is open.

        Raises:
            CameraNotFound, SettingRefused: it will not be.
            CameraLost: the process has ended.
        """
        message = await self._receive()
        if isinstance(message, NotOpened):
            kind: type[CameraError] = getattr(errors, message.error)
            raise kind(message.text)

    async def frame(self) -> Frame:
        """Receive the next frame, numbered from the opening.

        After a cancellation the rest of a frame may be under way: the process can only be ended then.

        Raises:
            CameraLost: there are no more.
        """
        header = await self._receive()
        assert isinstance(header, FrameHeader)
        image = np.empty(header.shape, np.uint8)
        await self._fill(image.data.cast("B"))
        return Frame(image, header.stamp, self._request.name, header.sequence)

    async def end(self) -> None:
        """Let the process release the camera and end; kill it when it does not."""
        with suppress(OSError):
            self._link.shutdown(socket.SHUT_RDWR)
        self._link.close()
        try:
            with suppress(TimeoutError):
                async with asyncio.timeout(END_S):
                    while self._process.poll() is None:  # noqa: ASYNC110 (a process sets no event)
                        await asyncio.sleep(POLL_S)
        finally:
            if self._process.poll() is None:
                self._process.kill()
                # A process inside an uninterruptible system call goes when that ends; nobody waits for it.
                with suppress(subprocess.TimeoutExpired):
                    self._process.wait(KILL_S)

    async def _receive(self) -> Message:
        length = bytearray(LENGTH.size)
        await self._fill(memoryview(length))
        content = bytearray(*LENGTH.unpack(length))
        await self._fill(memoryview(content))
        return decode_message(content)

    async def _fill(self, part: memoryview) -> None:
        loop = asyncio.get_running_loop()
        while part:
            try:
                count = await loop.sock_recv_into(self._link, part)
            except OSError:
                count = 0
            if count == 0:
                raise CameraLost(
                    f"camera {self._request.name} is lost: {self._request.source.place} gives no more images"
                )
            part = part[count:]
