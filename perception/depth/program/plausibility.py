"""Whether images and motion can belong together, in a sentence for whoever reads the map."""

import numpy as np

from perception.camera.motion import Motion
from perception.depth.errors import MotionError
from perception.depth.estimator import LEAST_PARALLAX_PX, DepthMap
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.settings import DepthSettings

FAR_PART = 0.25
"""A point at `far` that moves by more than this part of the image's width is not where the motion puts it."""
FEW = 0.5
"""Fewer confirmed pixels than this part mean that the images do not follow the motion."""
VAGUE, MOST = 0.8, 0.9
"""A map whose median σ_Z/Z is above the one while fewer than the other part are confirmed follows no motion either."""
END = 1.25
"""A map of which the greater part is within this factor of `near` or `far` would lie beyond."""


def check_motion(
    camera: Pinhole, motion: Motion, shape: tuple[int, int], settings: DepthSettings, names: tuple[str, str]
) -> None:
    """Refuse a motion that no scene between `near` and `far` could show.

    Raises:
        MotionError: the views do not overlap, or the unit of the translation cannot be metres.
    """
    height, width = shape
    pair = f"from {names[0]} to {names[1]}"
    centre = Epipolar(camera, Motion(motion.rotation, np.zeros(3)), shape).homography(0.0) @ np.array(
        [width / 2, height / 2, 1]
    )
    apart = (
        np.inf if centre[2] <= 0 else float(np.abs(centre[:2] / centre[2] - (width / 2, height / 2)).max())
    )
    if apart > max(width, height):
        raise MotionError(
            f"{pair} the camera turns by {np.degrees(motion.angle):.0f}°, so that the views do not overlap:"
            " are the angles in radians?"
        )
    moved = Epipolar(camera, motion, shape).parallax(1 / settings.far, 0.0)
    if moved > FAR_PART * width:
        raise MotionError(
            f"{pair} the camera moves {motion.distance:.4g} m: even a point at {settings.far:g} m would shift by"
            f" {moved:.0f} px of {width}; is the translation in metres?"
        )


def explain_no_parallax(
    camera: Pinhole, motion: Motion, shape: tuple[int, int], settings: DepthSettings
) -> str:
    """Why no depth follows from a motion by which the estimator only warped the map."""
    if motion.distance == 0:
        if motion.angle == 0:
            return "the camera did not move: no depth can follow from it"
        return (
            f"the camera only turned, by {np.degrees(motion.angle):.3g}°: no depth can follow from a rotation"
        )
    moved = Epipolar(camera, motion, shape).parallax(1 / settings.near, 1 / settings.far)
    return (
        f"the camera moved {motion.distance:.3g} m: even a point at {settings.near:g} m would shift by only {moved:.2g}"
        f" px, less than {LEAST_PARALLAX_PX} px; no depth can follow (is the translation in metres?)"
    )


def find_implausibility(result: DepthMap, settings: DepthSettings) -> str | None:
    """A sentence when the match itself shows that images and motion do not belong together; else None."""
    value, variance = result.state.value, result.state.variance
    known = np.isfinite(value) & (value > 0)
    if not result.measured or not known.any():
        return None
    found = None
    depth, spread = (
        1 / float(np.median(value[known])),
        float(np.median(np.sqrt(variance[known]) / value[known])),
    )
    if result.confirmed < FEW:
        found = f"only {100 * result.confirmed:.0f} % of the pixels agree with the motion both ways"
    elif depth < settings.near * END or depth > settings.far / END:
        found = (
            f"half of the image is at the end of the depths searched, {settings.near:g} to {settings.far:g} m"
        )
    elif spread > VAGUE and result.confirmed < MOST:
        found = (
            f"only {100 * result.confirmed:.0f} % of the pixels agree with the motion both ways, and their depth is"
            f" uncertain by {100 * spread:.0f} %"
        )
    if found is None:
        return None
    return f"{found}: implausible disparities; check the motion's unit, its axes and the order of the images"
