"""Images that already exist, played at a given rate: folders and videos, without a thread."""

import asyncio
from collections.abc import Iterator

import cv2
import numpy as np

from perception.camera.errors import CameraError, CameraLost, CameraNotFound
from perception.camera.frame import Frame, Image
from perception.camera.grey import as_grey
from perception.camera.slot import SlotCamera
from perception.camera.source import Source, images_in


class RecordedCamera(SlotCamera):
    """A folder of images or a video file, one image each 1/`rate` s of the loop's clock.

    Deterministic in virtual time. At the end it starts again when `repeat` is set, else CameraLost.
    """

    def __init__(
        self, source: Source, *, name: str = "", rate: float = 25.0, grey: bool = True, repeat: bool = False
    ) -> None:
        super().__init__(name or source.place, stall_after=max(2.0, 5.0 / rate))
        if not rate > 0.0:
            raise CameraNotFound(f"camera {self.name}: a rate of {rate} Hz is not possible")
        self._source = source
        self._period = 1.0 / rate
        self._grey = grey
        self._repeat = repeat
        self._player: asyncio.Task[None] | None = None

    async def open(self) -> None:
        """Start to play.

        Raises:
            CameraNotFound: the first image cannot be read.
        """
        await super().open()
        first = next(self._images(), None)
        if first is None:
            raise CameraNotFound(f"camera {self.name}: no image can be read")
        self._player = asyncio.create_task(self._play(), name=f"camera {self.name}")

    async def close(self) -> None:
        """Stop playing."""
        if self._player is not None:
            self._player.cancel()
            await asyncio.wait([self._player])
            self._player = None

    async def _play(self) -> None:
        try:
            await self._play_through()
        except CameraError as error:
            self.fail(error)

    async def _play_through(self) -> None:
        loop = asyncio.get_running_loop()
        start, sequence = loop.time(), 0
        while True:
            for image in self._images():
                stamp = start + sequence * self._period
                await asyncio.sleep(stamp - loop.time())
                self.put(Frame(image, stamp, self.name, sequence))
                sequence += 1
            if not self._repeat:
                await asyncio.sleep(start + sequence * self._period - loop.time())
                raise CameraLost(f"camera {self.name} has come to its end after {sequence} images")

    def _images(self) -> Iterator[Image]:
        if self._source.kind == "folder":
            for path in images_in(self._source.place):
                flag = cv2.IMREAD_GRAYSCALE if self._grey else cv2.IMREAD_COLOR
                image = cv2.imdecode(np.fromfile(path, np.uint8), flag)
                if image is None:
                    raise CameraLost(f"camera {self.name}: {path} cannot be read as an image")
                yield np.asarray(image, np.uint8)
            return
        video = cv2.VideoCapture(self._source.place)
        try:
            while True:
                got, image = video.read()
                if not got:
                    return
                yield as_grey(image) if self._grey else np.asarray(image, np.uint8)
        finally:
            video.release()
