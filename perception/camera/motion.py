"""The camera's motion between two images, finite: rotation and translation, thesis (2.19)."""

from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Motion:
    """Takes a point of the first camera's frame to the second's: P' = R P + t.

    Camera frames: x right, y down, z forward; t in metres. The camera's own displacement in the
    first frame is −Rᵀt.

    Raises:
        ValueError: the shapes are wrong, a value is not finite, or R is no rotation.
    """

    rotation: Matrix
    translation: Matrix

    def __post_init__(self) -> None:
        rotation, translation = np.asarray(self.rotation, float), np.asarray(self.translation, float)
        if rotation.shape != (3, 3) or translation.shape != (3,):
            raise ValueError("a motion is a 3×3 rotation and a translation of three components")
        if not (np.isfinite(rotation).all() and np.isfinite(translation).all()):
            raise ValueError("the motion holds a value that is no number")
        if abs(np.linalg.det(rotation) - 1) > 1e-3 or np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-3:
            raise ValueError("the motion's 3×3 part is no rotation")
        object.__setattr__(self, "rotation", rotation)
        object.__setattr__(self, "translation", translation)

    @classmethod
    def identity(cls) -> "Motion":
        """No motion."""
        return cls(np.eye(3), np.zeros(3))

    @classmethod
    def from_velocity(cls, velocity: Matrix, angular_velocity: Matrix, period: float) -> "Motion":
        """Integrate Ṗ = −T − ω×P, thesis (2.19), exactly over a time.

        Args:
            velocity: T of the camera in its own frame, 3, m/s.
            angular_velocity: ω, likewise, 3, rad/s.
            period: s.
        """
        twist = np.zeros((4, 4))
        wx, wy, wz = np.asarray(angular_velocity, float)
        twist[:3, :3] = -np.array([[0, -wz, wy], [wz, 0, -wx], [-wy, wx, 0]])
        twist[:3, 3] = -np.asarray(velocity, float)
        step = twist * period / 1024
        transform = (
            np.eye(4) + step + step @ step / 2 + step @ step @ step / 6 + step @ step @ step @ step / 24
        )
        for _ in range(10):
            transform = transform @ transform
        return cls(transform[:3, :3], transform[:3, 3])

    @classmethod
    def between(cls, first: Matrix, second: Matrix) -> "Motion":
        """The motion between two 4×4 camera-to-world poses."""
        transform = np.linalg.inv(second) @ first
        return cls(transform[:3, :3], transform[:3, 3])

    def inverse(self) -> "Motion":
        """From the second camera back to the first."""
        return Motion(self.rotation.T, -self.rotation.T @ self.translation)

    def then(self, following: "Motion") -> "Motion":
        """This motion followed by another."""
        return Motion(
            following.rotation @ self.rotation,
            following.rotation @ self.translation + following.translation,
        )

    @property
    def angle(self) -> float:
        """The rotation's angle in radians."""
        return float(np.linalg.norm(cv2.Rodrigues(self.rotation)[0]))

    @property
    def distance(self) -> float:
        """The length of the translation in metres."""
        return float(np.linalg.norm(self.translation))
