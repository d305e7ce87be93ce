"""Depth from motion, image by image: predict, match, regularise, fuse (thesis figure 2.8)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth.errors import ImageError
from perception.depth.filter.forward_warp import forward_warp
from perception.depth.filter.inverse_depth import InverseDepth, fuse, predict_inverse_depth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.keyframe import Keyframe
from perception.depth.match.coarse_match import LESS_COST, match_turned
from perception.depth.match.search_range import expected_range, widest_range, with_margin
from perception.depth.match.view import View
from perception.depth.pair import match_pair
from perception.depth.refine.motion_correction import correct_motion
from perception.depth.settings import DEFAULT, DepthSettings
from perception.depth.thesis.literal_match import match_literally
from perception.depth.thesis.warp import warp_map
from perception.image.memory import keep_freed_memory
from perception.image.quantile import known_median

Field = NDArray[np.float32]
LEAST_PARALLAX_PX = 0.5
"""A motion that moves no point beyond `near` by this much determines no depth."""
KEYFRAME_PARALLAX_PX = 12.0
"""While there are epipolar residuals, an image is kept until the median depth has moved by this much against it."""
LEAST_SIDE = 16
"""Shorter side, in pixels, below which an image holds no windows."""
LEAST_OVERLAP = 0.6
"""An image stays no keyframe when less than this part of the newest is confirmed by it, or could be."""


@dataclass(frozen=True)
class DepthMap:
    """The state after an image: inverse depth of the map's view, and how it was obtained."""

    state: InverseDepth
    measured: bool
    """False when the motion gave no parallax and the map was only warped."""
    confirmed: float
    """The part of the pixels whose match was confirmed both ways."""
    lowest: float = float("nan")
    highest: float = float("nan")
    """Between which inverse depths, 1/m, was searched."""
    residual_px: float = 0.0
    """Epipolar residual of the motion that was given, which was then corrected; 0 when it is within the matches' own
    deviation."""

    @property
    def depth(self) -> Field:
        """Z in metres, NaN where unknown."""
        return self.state.depth

    @property
    def depth_std(self) -> Field:
        """Standard deviation of Z in metres."""
        return self.state.depth_std


def as_grey(image: NDArray[np.uint8]) -> Field:
    """The image, height × width or × 3 (BGR), as grey levels in single precision.

    Raises:
        ImageError: it has another shape.
    """
    if image.ndim == 3 and image.shape[2] == 3:
        return cv2.cvtColor(image, cv2.COLOR_BGR2GRAY).astype(np.float32)
    if image.ndim != 2:
        raise ImageError(f"an image of shape {image.shape} is neither grey nor colour")
    return image.astype(np.float32)


class DepthFromMotion:
    """The recursive estimator. It keeps one image, the keyframe, and one map, in the newest view.

    The keyframe is the image before, or an older one while the motion has epipolar residuals: what such a motion
    errs along the lines is some pixels on any baseline, and so weighs less on a long one. With `anchored` the keyframe
    is the first image and the map stays in its view.
    """

    def __init__(self, camera: Pinhole, settings: DepthSettings = DEFAULT, anchored: bool = False) -> None:
        self.camera = camera
        self.settings = settings
        self.anchored = anchored
        self._keyframe: Keyframe | None = None
        self._state: InverseDepth | None = None
        self._colour = False

    @property
    def state(self) -> InverseDepth | None:
        """Inverse depth and variance of the map's view, or None before the first image."""
        return self._state

    def start(self, image: NDArray[np.uint8]) -> DepthMap:
        """Take the first image.

        Args:
            image: height × width grey or × 3 colour (BGR).

        Raises:
            ImageError: it is no image, or too small to hold a window.
        """
        view = View(as_grey(image))
        if min(view.shape) < LEAST_SIDE:
            raise ImageError(
                f"an image of {view.shape[1]}×{view.shape[0]}: at least {LEAST_SIDE}×{LEAST_SIDE} are needed"
            )
        keep_freed_memory()
        self._keyframe = Keyframe(view)
        self._colour = image.ndim == 3
        shape = self._keyframe.view.shape
        self._state = self._presumed(shape) if self.settings.literal else InverseDepth.unknown(shape)
        return DepthMap(self._state, False, 0.0)

    def step(self, image: NDArray[np.uint8], motion: Motion) -> DepthMap:
        """Take the next image.

        Args:
            image: height × width grey or × 3 colour (BGR), of the first image's size and kind.
            motion: from the view of the image before (the first one when anchored) to this one.

        Raises:
            ImageError: the image differs from the first in size or kind.
        """
        if self._keyframe is None or self._state is None:
            raise ImageError("the first image is given to start(), not to step()")
        view = View(as_grey(image))
        self._check(image, view)
        if self.settings.literal:
            return self._step_literally(view, motion)
        keyframe, shape = self._keyframe, view.shape
        keyframe.advance(motion, self.anchored)
        base, other = (keyframe.view, view) if self.anchored else (view, keyframe.view)
        geometry = Epipolar(self.camera, keyframe.given if self.anchored else keyframe.given.inverse(), shape)
        if self._parallax(keyframe.unmeasured, shape) < LEAST_PARALLAX_PX:
            if not self.anchored:
                self._state = self._predict(keyframe.correct(keyframe.corrected.then(motion)), shape)
                if not geometry.overlaps(LEAST_OVERLAP):
                    self._keyframe = Keyframe(view)
            return DepthMap(self._state, False, 0.0)
        limits = widest_range(geometry, self.settings)
        expected = expected_range(self._state, 0.0 if self.anchored else float(motion.translation[2]))
        searched = None if expected is None else with_margin(expected, limits, geometry)
        coarse, turned = match_turned(base, other, geometry, searched or limits, self.settings)
        tracked = keyframe.corrected.then(motion)
        apart = keyframe.given.inverse().then(tracked)
        if not self.anchored and apart.angle + apart.distance > 1e-6:
            # Steps that were measured one by one err the more the more of them there are since the keyframe.
            stepped = Epipolar(self.camera, tracked.inverse(), shape)
            again, turned_again = match_turned(base, other, stepped, searched or limits, self.settings)
            if again.cost < LESS_COST * coarse.cost:
                coarse, turned = again, turned_again
        if searched is None:
            searched = with_margin(coarse.range() or limits, limits, geometry)
        correction = correct_motion(coarse, self.settings).besides(turned)
        geometry = Epipolar(self.camera, correction.motion, shape)
        predicted = self._state
        if not self.anchored:
            predicted = self._predict(keyframe.correct(correction.motion.inverse()), shape)
        match = match_pair(base, other, geometry, *searched, predicted, self.settings, correction.error_px)
        pair = geometry.motion if self.anchored else geometry.motion.inverse()
        shared = np.float32(0.5 * keyframe.baseline_cosine(pair)) * match.refined
        self._state = fuse(
            predicted,
            match.measured,
            match.confirmed,
            self.settings.gate,
            match.reach,
            match.repeated,
            shared,
        )
        confirmed = float(match.confirmed.mean())
        keyframe.unmeasured = Motion.identity()
        middle = known_median(self._state.value[::4, ::4])
        far_enough = correction.residual_px == 0 or geometry.parallax(middle, 0.0) >= KEYFRAME_PARALLAX_PX
        if not self.anchored and (far_enough or confirmed < LEAST_OVERLAP):
            self._keyframe = Keyframe(view, seen_from=pair.translation)
        return DepthMap(self._state, True, confirmed, *searched, correction.residual_px)

    def _step_literally(self, view: View, motion: Motion) -> DepthMap:
        """The pair as chapter 2 treats it, the motion as it is given."""
        assert self._keyframe is not None
        assert self._state is not None
        shape = view.shape
        predicted = self._state if self.anchored else self._predict(motion, shape)
        base, other = (self._keyframe.view, view) if self.anchored else (view, self._keyframe.view)
        if not self.anchored:
            self._keyframe = Keyframe(view)
        self._state = predicted
        if self._parallax(motion, shape) < LEAST_PARALLAX_PX:
            return DepthMap(predicted, False, 0.0)
        geometry = Epipolar(self.camera, motion if self.anchored else motion.inverse(), shape)
        measured = match_literally(base.grey, other.grey, geometry, predicted, self.settings)
        everywhere = np.isfinite(measured.value)
        infinite = np.full(shape, np.inf, np.float32)
        self._state = fuse(predicted, measured, everywhere, float("inf"), infinite)
        return DepthMap(self._state, True, float(everywhere.mean()))

    def _parallax(self, motion: Motion, shape: tuple[int, int]) -> float:
        """The greatest displacement in pixels between a point at `near` and one at `far`."""
        return Epipolar(self.camera, motion, shape).parallax(1 / self.settings.near, 1 / self.settings.far)

    def _predict(self, motion: Motion, shape: tuple[int, int]) -> InverseDepth:
        assert self._state is not None
        if not np.isfinite(self._state.value).any():
            return self._state
        moved = Epipolar(self.camera, motion, shape).project(self._state.value)
        predicted = predict_inverse_depth(self._state, moved, self.settings.drift)
        if not self.settings.literal:
            return forward_warp(predicted, moved)
        warped, start = warp_map(predicted, moved, reach=2, independent=True), self._presumed(shape)
        hole = ~np.isfinite(warped.value)
        return InverseDepth(
            np.where(hole, start.value, warped.value),
            np.where(hole, start.variance, warped.variance),
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
        assert self._keyframe is not None
        if view.shape != self._keyframe.view.shape:
            height, width = self._keyframe.view.shape
            raise ImageError(
                f"an image of {view.shape[1]}×{view.shape[0]} after one of {width}×{height}: all must have one size"
            )
        if (image.ndim == 3) != self._colour:
            kinds = ("grey", "colour")
            raise ImageError(
                f"a {kinds[image.ndim == 3]} image after a {kinds[self._colour]} one: all must be alike"
            )
