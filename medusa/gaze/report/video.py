"""The annotated video of a gaze: both eyes side by side, the optical axes, the target, what is being done."""

import math
from collections import deque
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from medusa.errors import CommandError
from medusa.gaze.command import Sighting

if TYPE_CHECKING:
    from perception.camera.frame import Frame, Image
    from perception.camera.intrinsics import Intrinsics
    from perception.camera.pairing import FramePair

WIDTH_PX = 320
_DELAY_S = 1.0
_TARGET, _AXIS, _TEXT, _ALARM = (60, 220, 60), (40, 160, 255), (235, 235, 235), (60, 60, 240)
_BAND = (25, 25, 25)
_CODECS = {".avi": "MJPG", ".mp4": "mp4v", ".mkv": "MJPG"}


class GazeVideo:
    """Collects pairs and what was seen in them, and writes them out a second later.

    A pair whose sighting never came was exposed during a saccade, or too late to be used; the video shows it as
    such. Raises CommandError when the file cannot be written or its suffix names no codec.
    """

    def __init__(
        self, path: Path, intrinsics: "tuple[Intrinsics, Intrinsics]", rate: float, *, start: float = 0.0
    ) -> None:
        code = _CODECS.get(path.suffix.lower())
        if code is None:
            raise CommandError(f"{path}: a video ends in {', '.join(_CODECS)}")
        try:
            path.open("wb").close()
        except OSError as error:
            raise CommandError(f"{path}: {error.strerror}") from error
        self._intrinsics = intrinsics
        self._path = path
        self._rate = rate
        self._start = start
        self._code = cv2.VideoWriter.fourcc(*code)
        self._writer: cv2.VideoWriter | None = None
        self._pairs: deque[FramePair] = deque()
        self._sightings: dict[float, Sighting] = {}
        self.frames = 0

    def add_pair(self, pair: "FramePair") -> None:
        """A pair has come from the cameras."""
        self._pairs.append(pair)
        while self._pairs and self._pairs[0].stamp < pair.stamp - _DELAY_S:
            self._write(self._pairs.popleft())

    def add_sighting(self, pair: "FramePair", sighting: Sighting) -> None:
        """The loop has looked at a pair."""
        self._sightings[pair.stamp] = sighting

    def close(self) -> None:
        """Write what is left and close the file."""
        while self._pairs:
            self._write(self._pairs.popleft())
        if self._writer is not None:
            self._writer.release()
            self._writer = None

    def _write(self, pair: "FramePair") -> None:
        picture = annotate(pair, self._sightings.pop(pair.stamp, None), self._intrinsics, self._start)
        if self._writer is None:
            size = picture.shape[1], picture.shape[0]
            self._writer = cv2.VideoWriter(str(self._path), self._code, self._rate, size)
            if not self._writer.isOpened():
                raise CommandError(f"{self._path}: cannot be written as a video")
        if self._writer is not None:
            self._writer.write(picture)
            self.frames += 1


def annotate(
    pair: "FramePair",
    sighting: Sighting | None,
    intrinsics: "tuple[Intrinsics, Intrinsics]",
    start: float = 0.0,
) -> "Image":
    """Both eyes' pictures (height, 2 x 320 + gap, 3) with optical axis, target and joint angles.

    Times count from `start` on the loop's clock.
    """
    eyes = []
    for frame, lens, tangents, name in (
        (pair.left, intrinsics[0], None if sighting is None else sighting.left, "left"),
        (pair.right, intrinsics[1], None if sighting is None else sighting.right, "right"),
    ):
        eyes.append(_eye(frame, lens, tangents, name, used=sighting is not None))
    gap = np.full((eyes[0].shape[0], 6, 3), 25, np.uint8)
    picture = np.hstack([eyes[0], gap, eyes[1]])
    band = np.full((26, picture.shape[1], 3), 25, np.uint8)
    _put(band, f"{pair.stamp - start:6.2f} s", (6, 18), _TEXT)
    if sighting is None:
        _put(band, "exposed in a saccade: not used", (92, 18), _ALARM)
    else:
        joints = sighting.joints
        angles = (joints.pan, joints.tilt, joints.version, joints.vergence)
        names = ("pan", "tilt", "version", "vergence")
        words = "  ".join(
            f"{name} {math.degrees(angle):+6.1f}" for name, angle in zip(names, angles, strict=True)
        )
        _put(band, words, (92, 18), _TEXT)
    return np.ascontiguousarray(np.vstack([picture, band]))


def _eye(
    frame: "Frame | None", lens: "Intrinsics", tangents: tuple[float, float] | None, name: str, *, used: bool
) -> Any:
    height = round(WIDTH_PX * lens.height / lens.width)
    if frame is None:
        picture = np.full((height, WIDTH_PX, 3), 45, np.uint8)
        _put(picture, "no picture", (WIDTH_PX // 2 - 40, height // 2), _ALARM)
        return picture
    image = frame.image if frame.image.ndim == 3 else cv2.cvtColor(frame.image, cv2.COLOR_GRAY2BGR)
    picture = np.asarray(cv2.resize(image, (WIDTH_PX, height), interpolation=cv2.INTER_NEAREST), np.uint8)
    fitting = lens.scaled(WIDTH_PX, height)
    axis = round(fitting.cx), round(fitting.cy)
    cv2.drawMarker(picture, axis, _AXIS, cv2.MARKER_CROSS, 22, 1, cv2.LINE_AA)
    if tangents is not None:
        place = round(fitting.fx * tangents[0] + fitting.cx), round(fitting.fy * tangents[1] + fitting.cy)
        cv2.circle(picture, place, 14, _TARGET, 2, cv2.LINE_AA)
    elif used:
        _put(picture, "target not seen", (8, height - 10), _ALARM)
    _put(picture, name, (8, 18), _TEXT)
    return picture


def _put(picture: Any, words: str, place: tuple[int, int], colour: tuple[int, int, int]) -> None:
    (width, height), below = cv2.getTextSize(words, cv2.FONT_HERSHEY_SIMPLEX, 0.42, 1)
    corners = (place[0] - 3, place[1] - height - 3), (place[0] + width + 3, place[1] + below)
    cv2.rectangle(picture, *corners, _BAND, cv2.FILLED)
    cv2.putText(picture, words, place, cv2.FONT_HERSHEY_SIMPLEX, 0.42, colour, 1, cv2.LINE_AA)
