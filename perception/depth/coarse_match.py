"""The match on the coarsest level of the pyramid: where to search on the finest, and whether the motion is right."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.depth.epipolar import Epipolar
from perception.depth.inverse_depth import InverseDepth
from perception.depth.quantile import quantiles
from perception.depth.settings import Settings
from perception.depth.sweep_choice import Choice, choose_planes
from perception.depth.view import View

FEWEST = 0.02
"""A smaller part of the pixels confirmed says nothing about the range."""


@dataclass(frozen=True)
class CoarseMatch:
    """The two pictures of the coarsest level, their geometry, what was chosen, and how many pixels of the finest
    level make one."""

    base: View
    other: View
    geometry: Epipolar
    choice: Choice
    factor: float

    @property
    def cost(self) -> float:
        """Mean matching cost of all pixels, 0 to 1: the less, the better the motion explains the pictures."""
        return float(self.choice.cost.mean())

    def range(self) -> tuple[float, float] | None:
        """Between which inverse depths all but a hundredth of the confirmed pixels lie; None when hardly any is."""
        sure = cv2.erode(self.choice.sure.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        if sure.mean() < FEWEST:
            return None
        low, high = quantiles(self.choice.inverse_depth[sure], 0.005, 0.995)
        return low, high


def match_coarsely(
    base: View, other: View, geometry: Epipolar, limits: tuple[float, float], settings: Settings
) -> CoarseMatch:
    """Choose a plane for every pixel of the coarsest level, by these two pictures alone.

    Args:
        limits: least and greatest inverse depth searched, 1/m.
    """
    small, small_other = base.level(settings.levels - 1), other.level(settings.levels - 1)
    shape = small.shape
    factor = base.shape[1] / shape[1]
    coarse = Epipolar(geometry.camera.scaled(1 / factor), geometry.motion, shape)
    unknown = InverseDepth.unknown(shape)
    choice = choose_planes(small, small_other, coarse, coarse.planes(*limits), unknown, settings)
    return CoarseMatch(small, small_other, coarse, choice, factor)
