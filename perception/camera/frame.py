"""Frames: images with the moment of their exposure; and cameras, which give them."""

from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Frame:
    """One image, height × width grey or × 3 BGR, and when it was exposed.

    `stamp` is the middle of the exposure, in seconds on the clock of the event loop.
    `sequence` counts the camera's exposures: a gap of n is n - 1 lost images.
    """

    image: Image
    stamp: float
    camera: str
    sequence: int

    @property
    def size(self) -> tuple[int, int]:
        """Width and height in pixels."""
        return int(self.image.shape[1]), int(self.image.shape[0])


@dataclass(frozen=True)
class CameraStatistics:
    """What a camera has done since it was opened."""

    received: int = 0
    dropped: int = 0
    reopened: int = 0


class Camera(Protocol):
    """A source of frames: a device, a file, a URL or an emulated camera."""

    name: str

    @property
    def statistics(self) -> CameraStatistics:
        """Frames received, frames nobody took in time, times the camera was reopened."""
        ...

    def latest(self) -> Frame | None:
        """The newest frame, None before the first.

        Raises:
            CameraError: the camera is down.
        """
        ...

    def frames(self) -> AsyncIterator[Frame]:
        """Every new frame from now on, the newest one if several came meanwhile.

        Raises:
            CameraError: the camera is down.
        """
        ...

    async def __aenter__(self) -> "Camera": ...

    async def __aexit__(self, *exc: Any) -> None: ...
