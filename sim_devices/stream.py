"""A camera on the loopback: its pictures as a y4m stream over TCP, which OpenCV opens as tcp://127.0.0.1:PORT."""

import asyncio
import logging
from collections.abc import Callable
from fractions import Fraction
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from sim_devices.camera import Picture, SimulatedCamera

log = logging.getLogger(__name__)
_FRAMES_AHEAD = 2


def header(width: int, height: int, rate: float) -> bytes:
    """The first line of a grey y4m stream."""
    ratio = Fraction(rate).limit_denominator(1000)
    return f"YUV4MPEG2 W{width} H{height} F{ratio.numerator}:{ratio.denominator} Ip A1:1 Cmono\n".encode(
        "ascii"
    )


def frame(image: NDArray[np.uint8]) -> bytes:
    """One frame of the stream."""
    return b"FRAME\n" + image.tobytes()


class CameraStream:
    """Serves one camera to any number of clients on 127.0.0.1; one that reads too slowly loses frames."""

    def __init__(self, camera: SimulatedCamera, port: int = 0) -> None:
        self._camera = camera
        self._port = port
        self._server: asyncio.Server | None = None
        self._clients: set[asyncio.StreamWriter] = set()
        self._take_off: Callable[[], None] | None = None
        self.dropped = 0

    async def __aenter__(self) -> Self:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", self._port)
        self._port = self._server.sockets[0].getsockname()[1]
        return self

    async def __aexit__(self, *exc: Any) -> None:
        if self._server is not None:
            self._server.close()
        if self._take_off is not None:
            self._take_off()
            self._take_off = None
        for writer in list(self._clients):
            writer.close()
        self._clients.clear()

    @property
    def url(self) -> str:
        """The address that OpenCV opens."""
        return f"tcp://127.0.0.1:{self._port}"

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        part = self._camera.window or self._camera.optics.whole
        writer.write(header(part.width, part.height, self._camera.sensor.rate))
        self._clients.add(writer)
        if self._take_off is None:
            self._take_off = self._camera.deliver_to(self._send)
        try:
            # Nothing is expected from the client: this returns when it goes.
            while await reader.read(1024):
                pass
        except ConnectionError as error:
            log.debug("a client of camera %s is gone: %s", self._camera.name, error)
        finally:
            self._clients.discard(writer)
            writer.close()
            if not self._clients and self._take_off is not None:
                self._take_off()
                self._take_off = None

    def _send(self, picture: Picture) -> None:
        data = frame(picture.image)
        for writer in self._clients:
            if writer.transport.get_write_buffer_size() > _FRAMES_AHEAD * len(data):
                self.dropped += 1
            else:
                writer.write(data)
