"""From a pair of pictures to a sighting: the target's detector in each eye, pixels to tangents."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import cv2
import numpy as np

from medusa.gaze.command import Sighting
from medusa.kinematics import Joints, Tangents, Vector
from perception.target import Image, Target

if TYPE_CHECKING:
    from perception.camera.frame import Frame
    from perception.camera.intrinsics import Intrinsics
    from perception.camera.pairing import FramePair

Detector = Callable[[Image], Target | None]


class Retina:
    """Both eyes' optics and detectors; a detector may remember (a patch's does), so each eye has its own.

    turns: rotations (3, 3) from each camera's own optical axes to those its joint means, by calibration.
    """

    def __init__(
        self,
        left: "Intrinsics",
        right: "Intrinsics",
        detect_left: Detector,
        detect_right: Detector,
        *,
        turns: tuple[Vector, Vector] | None = None,
    ) -> None:
        left_turn, right_turn = turns if turns is not None else (np.eye(3), np.eye(3))
        self._eyes = ((left, detect_left, left_turn), (right, detect_right, right_turn))

    def look(self, pair: "FramePair", joints: Joints) -> Sighting:
        """What the pair shows, the joints having stood so at its exposure."""
        tangents: list[Tangents | None] = []
        sigmas: list[float] = []
        for frame, (intrinsics, detect, turn) in zip((pair.left, pair.right), self._eyes, strict=True):
            seen = None if frame is None else self._see(frame, intrinsics, detect, turn)
            tangents.append(None if seen is None else seen[0])
            if seen is not None:
                sigmas.append(seen[1])
        return Sighting(pair.stamp, joints, tangents[0], tangents[1], max(sigmas, default=1.0))

    @staticmethod
    def _see(
        frame: "Frame", intrinsics: "Intrinsics", detect: Detector, turn: Vector
    ) -> tuple[Tangents, float] | None:
        width, height = frame.size
        fitting = (
            intrinsics
            if (width, height) == (intrinsics.width, intrinsics.height)
            else intrinsics.scaled(width, height)
        )
        image = frame.image
        grey = image if image.ndim == 2 else np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY), np.uint8)
        target = detect(grey)
        if target is None:
            return None
        ray = turn @ np.append(fitting.rays(np.array([target.x_px, target.y_px])), 1.0)
        return (float(ray[0] / ray[2]), float(ray[1] / ray[2])), target.sigma_px / min(fitting.fx, fitting.fy)
