"""The latest-frame slot: a camera's newest image, what was dropped over it, and why it is down."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any, Self

from perception.camera.errors import CameraError, CameraStalled, FrameSizeChanged
from perception.camera.frame import CameraStatistics, Frame


class SlotCamera:
    """A camera whose source puts frames in from the event loop: `put` and `fail`.

    Only the newest frame is kept; one that is replaced before anybody took it counts as dropped, as do the
    gaps in the sequence numbers. Silence for more than `stall_after` seconds raises CameraStalled from
    `latest` and `frames`; another frame ends that state. A frame of another size than the first is
    refused.
    """

    def __init__(self, name: str, *, stall_after: float = 2.0) -> None:
        self.name = name
        self.stall_after = stall_after
        self._frame: Frame | None = None
        self._taken = True
        self._error: CameraError | None = None
        self._changed: asyncio.Event | None = None
        self._size: tuple[int, int] | None = None
        self._silent_since = 0.0
        self._received = self._dropped = self._reopened = 0

    @property
    def statistics(self) -> CameraStatistics:
        """Frames received, dropped, and how often the source was reopened."""
        return CameraStatistics(self._received, self._dropped, self._reopened)

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(self, *exc: Any) -> None:
        await self.close()

    async def open(self) -> None:
        """Begin to wait for frames."""
        self._changed = asyncio.Event()
        self._silent_since = asyncio.get_running_loop().time()

    async def close(self) -> None:
        """No more frames."""

    def put(self, frame: Frame) -> None:
        """The source has a new frame."""
        if self._size is None:
            self._size = frame.size
        elif frame.size != self._size:
            self.fail(
                FrameSizeChanged(
                    f"camera {self.name}: frames were {self._size[0]} x {self._size[1]} pixels and are now "
                    f"{frame.size[0]} x {frame.size[1]}"
                )
            )
            return
        if self._frame is not None:
            self._dropped += max(0, frame.sequence - self._frame.sequence - 1)
            self._dropped += 0 if self._taken else 1
        self._received += 1
        self._frame, self._taken, self._error = frame, False, None
        self._silent_since = asyncio.get_running_loop().time()
        self._signal()

    def fail(self, error: CameraError) -> None:
        """The source is down: `latest` and `frames` raise the error until the next frame."""
        self._error = error
        self._signal()

    def reopened(self) -> None:
        """The source has been opened again; it may come back in another size."""
        self._reopened += 1
        self._size = self._frame = self._error = None
        self._silent_since = asyncio.get_running_loop().time()

    def latest(self) -> Frame | None:
        """The newest frame, None before the first.

        Raises:
            CameraError: the camera is down.
        """
        if self._error is not None:
            raise self._error
        if asyncio.get_running_loop().time() - self._silent_since > self.stall_after:
            raise self._stalled()
        self._taken = True
        return self._frame

    async def frames(self) -> AsyncIterator[Frame]:
        """Every new frame from now on, the newest if several came meanwhile.

        Raises:
            CameraError: the camera is down.
        """
        seen = self._frame.sequence if self._frame is not None else -1
        while True:
            seen = await self.wait_for_frame(seen)
            frame = self._frame
            assert frame is not None
            self._taken = True
            yield frame

    async def wait_for_frame(self, seen: int) -> int:
        """Wait until the newest frame is not number `seen`, and return its number.

        Raises:
            CameraError: the camera is down, or was never opened.
        """
        if self._changed is None:
            raise CameraError(f"camera {self.name} is not open")
        while True:
            if self._error is not None:
                raise self._error
            if self._frame is not None and self._frame.sequence != seen:
                return self._frame.sequence
            self._changed.clear()
            deadline = self._silent_since + self.stall_after
            try:
                async with asyncio.timeout_at(deadline):
                    await self._changed.wait()
            except TimeoutError:
                raise self._stalled() from None

    def _stalled(self) -> CameraStalled:
        silence = asyncio.get_running_loop().time() - self._silent_since
        return CameraStalled(
            f"camera {self.name} has sent no frame for {silence:.2f} s (allowed: {self.stall_after:.2f} s)"
        )

    def _signal(self) -> None:
        if self._changed is not None:
            self._changed.set()
