"""Targets of a gaze: a bright spot or a textured patch, found in an image; disparity at the fovea."""

from perception.target.bright import Image, Shape, Target, detect_bright_target, subsample
from perception.target.correlation import Disparity, PatchTarget, estimate_disparity

__all__ = [
    "Disparity",
    "Image",
    "PatchTarget",
    "Shape",
    "Target",
    "detect_bright_target",
    "estimate_disparity",
    "subsample",
]
