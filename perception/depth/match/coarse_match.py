"""The match on the coarsest level of the pyramid: where to search on the finest, and whether the motion is right."""

from dataclasses import dataclass

import cv2
import numpy as np

from perception.camera.motion import Motion
from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.plane_choice import Choice, choose_planes
from perception.depth.match.view import View
from perception.depth.settings import DepthSettings
from perception.image.quantile import quantiles

COSTLY = 0.22
"""A right motion matches the coarsest level at .05 to .17, in noise and poor contrast too; one that errs by more than a
pixel of it, at .24 and more."""
LESS_COST = 0.75
"""Another motion than the one that is given is taken when it matches at this part of the cost."""
TURNS_PX = (1.5, -1.5, 3.0, -3.0, 4.5, -4.5)
"""How far the camera is turned about its baseline in search of a match, pixels of the coarsest level."""
FEWEST = 0.02
"""A smaller part of the pixels confirmed determines no range."""


@dataclass(frozen=True)
class CoarseMatch:
    """The two images of the coarsest level, their geometry, what was chosen, and how many pixels of the finest
    level make one."""

    base: View
    other: View
    geometry: Epipolar
    choice: Choice
    factor: float

    @property
    def cost(self) -> float:
        """Mean matching cost of all pixels, 0 to 1: the less, the better the motion explains the images."""
        return float(self.choice.cost.mean())

    def range(self) -> tuple[float, float] | None:
        """Between which inverse depths all but a hundredth of the confirmed pixels lie; None when hardly any is."""
        confirmed = cv2.erode(self.choice.confirmed.astype(np.uint8), np.ones((3, 3), np.uint8)).astype(bool)
        if confirmed.mean() < FEWEST:
            return None
        low, high = quantiles(self.choice.inverse_depth[confirmed], 0.005, 0.995)
        return low, high


def match_coarsely(
    base: View, other: View, geometry: Epipolar, limits: tuple[float, float], settings: DepthSettings
) -> CoarseMatch:
    """Choose a plane for every pixel of the coarsest level, by these two images alone.

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


def match_turned(
    base: View, other: View, geometry: Epipolar, limits: tuple[float, float], settings: DepthSettings
) -> tuple[CoarseMatch, float]:
    """The same, the other camera turned about its baseline until the images match when they do not as they are.

    That moves all points across their lines, where nothing but an error of the motion does.

    Returns:
        The match and by how many pixels of the finest level was turned, 0 where it was not.
    """
    coarse = match_coarsely(base, other, geometry, limits, settings)
    given = geometry.motion
    best, turned = coarse, 0.0
    if coarse.cost > COSTLY and given.distance > 0:
        for step in TURNS_PX:
            turn = cv2.Rodrigues(given.translation * (step / coarse.geometry.camera.fx / given.distance))[0]
            motion = Motion(turn @ given.rotation, given.translation)
            there = Epipolar(geometry.camera, motion, geometry.shape)
            found = match_coarsely(base, other, there, limits, settings)
            if found.cost < min(best.cost, LESS_COST * coarse.cost):
                best, turned = found, abs(step) * coarse.factor
    return best, turned
