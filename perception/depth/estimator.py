"""Depth from motion, picture by picture: predict, match, regularise, fuse (thesis figure 2.8)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.carry import carry_map
from perception.depth.epipolar import Epipolar
from perception.depth.errors import ImageError
from perception.depth.intrinsics import Intrinsics
from perception.depth.inverse_depth import InverseDepth, fuse, predict_inverse_depth
from perception.depth.literal_match import match_literally
from perception.depth.matching import match_pair
from perception.depth.motion import Motion
from perception.depth.search_range import search_range
from perception.depth.settings import DEFAULT, Settings
from perception.depth.view import View
from perception.depth.warp import warp_map

Field = NDArray[np.float32]
LEAST_PARALLAX_PX = 0.5
"""A motion that moves no point nearer than `near` by this much tells nothing about depth."""


@dataclass(frozen=True)
class DepthMap:
    """The state after a picture: inverse depth of the map's view, and how it came about."""

    state: InverseDepth
    measured: bool
    """False when the motion gave no parallax and the map was only carried along."""
    confirmed: float
    """The part of the pixels whose match was confirmed both ways."""
    lowest: float = float("nan")
    highest: float = float("nan")

    @property
    def depth(self) -> Field:
        """Z in metres, NaN where unknown."""
        return self.state.depth

    @property
    def depth_std(self) -> Field:
        """Standard deviation of Z in metres."""
        return self.state.depth_std


def as_grey(image: NDArray[np.uint8]) -> Field:
    """The picture as grey levels in single precision."""
    if image.ndim == 3 and image.shape[2] == 3:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    if image.ndim != 2:
        raise ImageError(f"a picture of shape {image.shape} is neither grey nor colour")
    return image.astype(np.float32)


class DepthFromMotion:
    """The recursive estimator. It keeps one picture and one map; the map stands in the newest view.

    With `anchored` the kept picture is the first one and the map stays in its view.
    """

    def __init__(self, camera: Intrinsics, settings: Settings = DEFAULT, anchored: bool = False) -> None:
        self.camera = camera
        self.settings = settings
        self.anchored = anchored
        self._kept: View | None = None
        self._state: InverseDepth | None = None
        self._colour = False

    @property
    def state(self) -> InverseDepth | None:
        """Inverse depth and variance of the map's view, or None before the first picture."""
        return self._state

    def start(self, image: NDArray[np.uint8]) -> DepthMap:
        """Take the first picture."""
        self._kept = View(as_grey(image))
        self._colour = image.ndim == 3
        shape = self._kept.shape
        self._state = self._presumed(shape) if self.settings.literal else InverseDepth.unknown(shape)
        return DepthMap(self._state, False, 0.0)

    def step(self, image: NDArray[np.uint8], motion: Motion) -> DepthMap:
        """Take the next picture.

        Args:
            image: height × width grey or × 3 colour (BGR), of the first picture's size and kind.
            motion: from the view of the kept picture (the one before, or the first one when anchored) to this one.

        Raises:
            ImageError: the picture differs from the first in size or kind.
        """
        if self._kept is None or self._state is None:
            raise ImageError("the first picture is given to start(), not to step()")
        view = View(as_grey(image))
        self._check(image, view)
        shape = view.shape
        if self.anchored:
            predicted, base, other = self._state, self._kept, view
            geometry = Epipolar(self.camera, motion, shape)
        else:
            predicted, base, other = self._predict(motion, shape), view, self._kept
            geometry = Epipolar(self.camera, motion.inverse(), shape)
            self._kept = view
        near, far = 1 / self.settings.near, 1 / self.settings.far
        if geometry.parallax(near, far) < LEAST_PARALLAX_PX:
            self._state = predicted
            return DepthMap(predicted, False, 0.0)
        if self.settings.literal:
            measured = match_literally(base.grey, other.grey, geometry, predicted, self.settings)
            everywhere = np.isfinite(measured.value)
            infinite = np.full(shape, np.inf, np.float32)
            self._state = fuse(predicted, measured, everywhere, float("inf"), infinite)
            return DepthMap(self._state, True, float(everywhere.mean()))
        lowest, highest = search_range(base, other, geometry, predicted, self.settings)
        match = match_pair(base, other, geometry, lowest, highest, predicted, self.settings)
        self._state = fuse(predicted, match.measured, match.sure, self.settings.gate, match.reach)
        return DepthMap(self._state, True, float(match.sure.mean()), lowest, highest)

    def _predict(self, motion: Motion, shape: tuple[int, int]) -> InverseDepth:
        assert self._state is not None
        if not np.isfinite(self._state.value).any():
            return self._state
        moved = Epipolar(self.camera, motion, shape).project(self._state.value)
        predicted = predict_inverse_depth(self._state, moved, self.settings.drift)
        if not self.settings.literal:
            return carry_map(predicted, moved)
        warped, start = warp_map(predicted, moved, reach=2, independent=True), self._presumed(shape)
        void = ~np.isfinite(warped.value)
        return InverseDepth(
            np.where(void, start.value, warped.value),
            np.where(void, start.variance, warped.variance),
            start.cost,
        )

    def _presumed(self, shape: tuple[int, int]) -> InverseDepth:
        """What is assumed before anything is seen, thesis section 2.9.1: one depth everywhere."""
        value = 1 / self.settings.start_depth
        spread = (value * self.settings.start_std) ** 2
        return InverseDepth(
            np.full(shape, value, np.float32), np.full(shape, spread, np.float32), np.zeros(shape, np.float32)
        )

    def _check(self, image: NDArray[np.uint8], view: View) -> None:
        assert self._kept is not None
        if view.shape != self._kept.shape:
            height, width = self._kept.shape
            raise ImageError(
                f"a picture of {view.shape[1]}×{view.shape[0]} after one of {width}×{height}: all must have one size"
            )
        if (image.ndim == 3) != self._colour:
            kinds = ("grey", "colour")
            raise ImageError(
                f"a {kinds[image.ndim == 3]} picture after a {kinds[self._colour]} one: all must be alike"
            )
