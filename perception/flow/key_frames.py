"""Past frames with the camera's motion since, and which of them to compare the present one with."""

from collections import deque
from dataclasses import dataclass
from math import isfinite

from perception.flow.geometry import STILL, CameraMotion, Ray
from perception.flow.strip import Strip


@dataclass(frozen=True, slots=True)
class KeyFrame:
    """A past frame, and where the camera had come since the first one."""

    strip: Strip
    stamp: float
    way: CameraMotion


@dataclass(frozen=True, slots=True)
class Candidate:
    """A past frame, by how much the window's middle should have shifted since, and what of that is parallax."""

    frame: KeyFrame
    flow_px: float
    parallax_px: float


class KeyFrames:
    """The last `capacity` frames between which the camera has moved, at most `oldest_s` old."""

    def __init__(self, capacity: int, oldest_s: float) -> None:
        self._frames: deque[KeyFrame] = deque(maxlen=capacity)
        self._oldest_s = oldest_s
        self._way = STILL

    def move(self, motion: CameraMotion, stamp: float) -> None:
        """The camera has moved on since the last call, and the time is `stamp`."""
        self._way = self._way.then(motion)
        while self._frames and stamp - self._frames[0].stamp > self._oldest_s:
            self._frames.popleft()

    def motion_since(self, frame: KeyFrame) -> CameraMotion:
        """The camera's motion from a kept frame to the present."""
        return self._way.since(frame.way)

    def keep(self, strip: Strip, stamp: float, ray: Ray, inverse_depth: float, least_px: float) -> None:
        """Keep the present frame, if a wall there would have shifted by that much since the last one kept."""
        if self._frames:
            _, parallax = ray.predict_flow(inverse_depth, self.motion_since(self._frames[-1]))
            if abs(parallax) < least_px:
                return
        self._frames.append(KeyFrame(strip, stamp, self._way))

    def candidates(self, ray: Ray, inverse_depth: float, enough_px: float, most_px: float) -> list[Candidate]:
        """Frames since which a wall there should have shifted by `most_px` or less, newest first; the newest always.

        The last one is the first whose parallax is enough.
        """
        found: list[Candidate] = []
        for frame in reversed(self._frames):
            flow, parallax = ray.predict_flow(inverse_depth, self.motion_since(frame))
            if abs(flow) <= most_px or (not found and isfinite(flow)):
                found.append(Candidate(frame, flow, parallax))
            if abs(parallax) >= enough_px:
                break
        return found


def nearest_to(candidates: list[Candidate], parallax_px: float) -> Candidate | None:
    """The candidate whose parallax is nearest to that wanted, None of none."""
    return min(candidates, key=lambda c: abs(abs(c.parallax_px) - parallax_px), default=None)
