"""From a pair of pictures to a sighting: the target's detector in each eye, pixels to tangents."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import cv2
import numpy as np

from medusa.gaze.command import Sighting
from medusa.kinematics import Joints, Tangents, Vector
from perception.target import Image, Target, estimate_disparity

if TYPE_CHECKING:
    from perception.camera.frame import Frame
    from perception.camera.intrinsics import Intrinsics
    from perception.camera.pairing import FramePair

_WINDOW, _LEAST_WINDOW = 21, 7
Detector = Callable[[Image], Target | None]


class Retina:
    """Both eyes' optics and detectors; a detector may remember (a patch's does), so each eye has its own.

    turns: rotations (3, 3) from each camera's own optical axes to those its joint means, by calibration.
    by_disparity: the right eye looks for what the left eye has around its target (by correlation, whatever it
    is) instead of detecting the target itself.
    """

    def __init__(
        self,
        left: "Intrinsics",
        right: "Intrinsics",
        detect_left: Detector,
        detect_right: Detector,
        *,
        turns: tuple[Vector, Vector] | None = None,
        by_disparity: bool = False,
    ) -> None:
        left_turn, right_turn = turns if turns is not None else (np.eye(3), np.eye(3))
        self._by_disparity = by_disparity
        self._eyes = ((left, detect_left, left_turn), (right, detect_right, right_turn))

    def look(self, pair: "FramePair", joints: Joints) -> Sighting:
        """What the pair shows, the joints having stood so at its exposure."""
        (left_lens, detect_left, left_turn), (right_lens, detect_right, right_turn) = self._eyes
        left_image = None if pair.left is None else _grey(pair.left)
        right_image = None if pair.right is None else _grey(pair.right)
        left = None if left_image is None else detect_left(left_image)
        right = None
        if self._by_disparity and left is not None and left_image is not None and right_image is not None:
            right = _beside(left, left_image, right_image)
        elif right_image is not None:
            right = detect_right(right_image)
        tangents: list[Tangents | None] = []
        sigmas: list[float] = []
        for target, image, lens, turn in (
            (left, left_image, left_lens, left_turn),
            (right, right_image, right_lens, right_turn),
        ):
            seen = None if target is None or image is None else _direction(target, image, lens, turn)
            tangents.append(None if seen is None else seen[0])
            if seen is not None:
                sigmas.append(seen[1])
        return Sighting(pair.stamp, joints, tangents[0], tangents[1], max(sigmas, default=1.0))


def _grey(frame: "Frame") -> Image:
    image = frame.image
    return image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)


def _beside(target: Target, left: Image, right: Image) -> Target | None:
    """The left eye's target in the right image, by the disparity around it; None without texture or room."""
    height, width = left.shape
    column, row = round(target.x_px), round(target.y_px)
    room = min(column, width - 1 - column, row, height - 1 - row)
    if left.shape != right.shape or room < _LEAST_WINDOW // 2:
        return None
    window = min(_WINDOW, 2 * room + 1)
    found = estimate_disparity(
        left, right, centre_px=(column, row), window_px=window, reach_px=(width // 4, max(2, height // 20))
    )
    if found is None:
        return None
    return Target(
        target.x_px + found.x_px, target.y_px + found.y_px, target.area_px, found.confidence, target.sigma_px
    )


def _direction(
    target: Target, image: Image, intrinsics: "Intrinsics", turn: Vector
) -> tuple[Tangents, float]:
    height, width = image.shape
    fits = (width, height) == (intrinsics.width, intrinsics.height)
    fitting = intrinsics if fits else intrinsics.scaled(width, height)
    ray = turn @ np.append(fitting.rays(np.array([target.x_px, target.y_px])), 1.0)
    return (float(ray[0] / ray[2]), float(ray[1] / ray[2])), target.sigma_px / min(fitting.fx, fitting.fy)
