"""The flow of a window between two images, by warped least squares: no geometry, no memory."""

from math import nan

from perception.flow.search import NEAR_PX, search_near
from perception.flow.strip import COARSE_REACH, Strip
from perception.flow.warped import align
from perception.flow.window import Image, Window, WindowFlow

FARTHEST_PX = 20.0


def estimate_flow(
    now: Image, past: Image, window: Window, predicted_px: float = nan, farthest_px: float = FARTHEST_PX
) -> WindowFlow:
    """By how much the content of the present image's window has moved to the right since the past image.

    Unknown without texture, or where several shifts fit: two images alone cannot tell which.

    Args:
        predicted_px: the shift is sought within 8 px of it first.
        farthest_px: and then up to this far to both sides.

    Raises:
        ImageError: an image that is not grey, not uint8, or does not hold the window.
    """
    margin = int(farthest_px) + NEAR_PX + COARSE_REACH
    strip, past_strip = Strip(now, window, margin), Strip(past, window, margin)
    found = search_near(strip, past_strip, window, predicted_px, (-farthest_px, farthest_px))
    if not found.clear:
        return WindowFlow(nan, nan, found.texture)
    shift = align(strip, past_strip, window, found, found.peaks[0])
    return WindowFlow(shift.middle_px, shift.deviation_px, True)
