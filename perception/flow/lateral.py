"""The flow of the wall beside a moving body, and the inverse depth it means, image by image.

The present image is compared with that kept one from which the wall should have shifted by about 6 px: a shift's error
hardly grows with it, so a long way gives a sharp distance, and a short one loses little of the window. Where another
shift fits as well (stripes), past frames with shorter ways tell them apart, or the flow stays unknown.

Pure: no clock; the stamp is the image's.
"""

from dataclasses import dataclass
from math import isfinite, nan

from perception.camera.intrinsics import Intrinsics
from perception.flow.ambiguity import tell_apart
from perception.flow.errors import ImageError, SettingError
from perception.flow.geometry import CameraMotion, Ray
from perception.flow.key_frames import Candidate, KeyFrames, nearest_to
from perception.flow.search import NEAR_PX, Search, search_near
from perception.flow.strip import COARSE_REACH, Strip
from perception.flow.warped import UNKNOWN, Shift, align
from perception.flow.window import Image, Window

MOST_PX = 20
"""Greater shifts would leave too little of the window in both images."""
FARTHEST_PX = MOST_PX + NEAR_PX
KEEP_PX = 2.0
"""A frame is kept when the nearest wall would have shifted by this since the last: a body at rest keeps its past."""
BEHIND = -0.25
"""1/m. What is behind the camera by more than this, the way's own error, is no wall, and something else has moved."""
STEEPEST = 0.6
"""1/Z at the window's edge may differ by this part from that in its middle: a wall seen at 75° askew."""
SLANT_PARALLAX_PX = 1.0
"""With less parallax a slant is not known."""
REMEMBER_S = 1.0
"""For so long a measured distance predicts the next shift."""


@dataclass(frozen=True, slots=True)
class LateralSettings:
    """shift_px: the wall's shift that is aimed at. nearest_m: no wall is nearer than this when it is first seen.
    frames, oldest_s: how many past frames are kept, and for how long."""

    shift_px: float = 6.0
    nearest_m: float = 0.15
    frames: int = 26
    oldest_s: float = 3.0

    def __post_init__(self) -> None:
        if not 1 <= self.shift_px <= MOST_PX / 2:
            raise SettingError(f"shift_px is {self.shift_px}: it must be 1 to {MOST_PX / 2:g}")
        if not 0 < self.nearest_m < float("inf"):
            raise SettingError(f"nearest_m is {self.nearest_m}: it must be above 0 and finite")
        if self.frames < 2:
            raise SettingError(f"frames is {self.frames}: it must be at least 2")
        if not self.oldest_s > 0:
            raise SettingError(f"oldest_s is {self.oldest_s}: it must be above 0")


@dataclass(frozen=True, slots=True)
class SideMeasurement:
    """What one side sees. Every number is NaN where it is unknown; none is a zero that was not measured.

    stamp, past_stamp: of the two images compared, s. flow_px, deviation_px: shift of the window's middle between them,
    positive to the right, and its standard deviation. slope_px: the shift at the window's right edge minus that in its
    middle. inverse_depth, deviation: 1/Z along the optical axis, of what the window's middle shows now, 1/m; the
    deviation holds the odometry's if the motion had one. texture: whether both images show the same texture.
    ambiguous: several shifts fit, and no other frame could tell which. correlation: of the two images at the shift.
    motion: the camera's, between the two. A texture without a flow that is not ambiguous is not one wall's.
    """

    stamp: float
    past_stamp: float = nan
    flow_px: float = nan
    deviation_px: float = nan
    slope_px: float = nan
    slope_deviation_px: float = nan
    inverse_depth: float = nan
    deviation: float = nan
    texture: bool = False
    ambiguous: bool = False
    correlation: float = nan
    motion: CameraMotion | None = None


class LateralFlow:
    """Measures one side's wall; one object a camera.

    Args:
        intrinsics: of the images as they come; without distortion: straighten them first.
        window: where to look; None: 64×32 pixels in the middle.
    """

    def __init__(
        self, intrinsics: Intrinsics, window: Window | None = None, settings: LateralSettings | None = None
    ) -> None:
        if any(intrinsics.distortion):
            raise SettingError(
                "intrinsics with distortion: the flow needs straightened images, Intrinsics.undistort"
            )
        self.intrinsics = intrinsics
        self.window = window or Window.centred(intrinsics.width, intrinsics.height)
        self.settings = settings or LateralSettings()
        self._frames = KeyFrames(self.settings.frames, self.settings.oldest_s)
        self._ray = Ray((self.window.middle - intrinsics.cx) / intrinsics.fx, intrinsics.fx)
        self._stamp = -float("inf")
        self._expected = nan
        self._expected_until = -float("inf")
        reach = self.window.width / 2 / intrinsics.fx
        self._edges = self._ray.turned(-reach), self._ray.turned(reach)
        self._slant = 0.0

    def step(self, image: Image, stamp: float, motion: CameraMotion) -> SideMeasurement:
        """Measure against a past image.

        Args:
            image: grey, (height, width) of the intrinsics, uint8.
            stamp: the middle of its exposure, s, later than the last one.
            motion: of the camera since the last image; of the first image it is not used.

        Raises:
            ImageError: image of another size or type, or not later than the last.
            MotionError: motion that is not finite.
        """
        if image.shape[:2] != (self.intrinsics.height, self.intrinsics.width):
            raise ImageError(
                f"image of {image.shape[1]}×{image.shape[0]} pixels: the intrinsics are of"
                f" {self.intrinsics.width}×{self.intrinsics.height}"
            )
        if not stamp > self._stamp:
            raise ImageError(f"image stamped {stamp} s: it must be later than the last one, {self._stamp} s")
        motion.check()
        strip = Strip(image, self.window, FARTHEST_PX + COARSE_REACH)
        self._stamp = stamp
        self._frames.move(motion, stamp)
        if stamp > self._expected_until:
            self._expected = nan
        measurement = self._measure(strip, stamp)
        if isfinite(measurement.inverse_depth):
            self._expected, self._expected_until = measurement.inverse_depth, stamp + REMEMBER_S
        if not strip.clipped:
            self._frames.keep(strip, stamp, self._ray, 1 / self.settings.nearest_m, KEEP_PX)
        return measurement

    def _measure(self, strip: Strip, stamp: float) -> SideMeasurement:
        known, nearest = isfinite(self._expected), self.settings.nearest_m
        wall, wanted = (self._expected, self.settings.shift_px) if known else (1 / nearest, MOST_PX)
        candidates = self._frames.candidates(self._ray, wall, wanted, MOST_PX)
        best = nearest_to(candidates, wanted)
        if best is None:
            return SideMeasurement(stamp)
        motion = self._frames.motion_since(best.frame)
        past = best.frame.strip
        found = self._search(strip, best, motion)
        start: float | None = found.peaks[0] if found.peaks else nan
        if found.texture and not found.clear:
            start = tell_apart(
                strip, self.window, self._ray, self._frames, best, found, candidates, nearest, FARTHEST_PX
            )
        shift = UNKNOWN
        if start is not None and isfinite(start):
            slope, curve = self._shape(motion)
            shift = align(strip, past, self.window, found, start, slope, curve)
            shift = self._plausible(shift, curve, motion)
        inverse_depth, deviation = self._ray.estimate_inverse_depth(
            shift.middle_px, shift.deviation_px, motion
        )
        if inverse_depth < BEHIND - 3 * deviation:
            shift, inverse_depth, deviation = UNKNOWN, nan, nan
        return SideMeasurement(
            stamp,
            best.frame.stamp,
            shift.middle_px,
            shift.deviation_px,
            shift.slope_px,
            shift.slope_deviation_px,
            inverse_depth,
            deviation,
            texture=found.texture,
            ambiguous=found.texture and not found.clear and not isfinite(shift.middle_px),
            correlation=float(found.scores.max()),
            motion=motion,
        )

    def _plausible(self, shift: Shift, curve_px: float, motion: CameraMotion) -> Shift:
        """UNKNOWN for a shift that no wall can have, by its slope over the window; else its slant is remembered."""
        self._slant = 0.0
        if not abs(shift.middle_px - self._ray.predict_flow(0.0, motion)[0]) > SLANT_PARALLAX_PX:
            return shift
        left, right = self._edges
        middle = shift.middle_px + curve_px
        before, _ = left.estimate_inverse_depth(middle - shift.slope_px, 0.0, motion)
        after, _ = right.estimate_inverse_depth(middle + shift.slope_px, 0.0, motion)
        if not abs(after - before) <= STEEPEST * abs(after + before):
            return UNKNOWN
        self._slant = (after - before) / (after + before) if after + before else 0.0
        return shift

    def _search(self, strip: Strip, best: Candidate, motion: CameraMotion) -> Search:
        """Around the predicted shift, or wherever a wall can be."""
        everywhere = self._ray.flow_range(self.settings.nearest_m, MOST_PX, motion)
        predicted = best.flow_px if isfinite(self._expected) else nan
        return search_near(strip, best.frame.strip, self.window, predicted, everywhere)

    def _shape(self, motion: CameraMotion) -> tuple[float, float]:
        """The flow expected at the window's edges, px: the right one less the middle, and both less a straight line.

        A turn lifts both, by about f d (w/2f)², and so does a slanted wall that is passed slantwise.
        """
        wall, slant = (self._expected, self._slant) if isfinite(self._expected) else (0.0, 0.0)
        left, right = self._edges
        before, _ = left.predict_flow(wall * (1 - slant), motion)
        middle, _ = self._ray.predict_flow(wall, motion)
        after, _ = right.predict_flow(wall * (1 + slant), motion)
        slope, curve = (after - before) / 2, (before + after) / 2 - middle
        return (slope, curve) if isfinite(slope + curve) else (0.0, 0.0)
