"""A pinhole camera: pixels, focal lengths, principal point, and the part of the image that is wanted."""

from dataclasses import dataclass
from math import radians, tan

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Window:
    """A rectangle of pixels: the first column and row, and how many of each."""

    left: int
    top: int
    width: int
    height: int


@dataclass(frozen=True)
class Optics:
    """Width, height and intrinsics in pixels; the centre of the upper left pixel is (0, 0).

    Camera axes: x right, y down, z forward. A point (X, Y, Z) falls on (fx X/Z + cx, fy Y/Z + cy).
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1 or not (self.fx > 0.0 and self.fy > 0.0):
            raise ValueError(f"an image needs pixels and positive focal lengths, got {self}")

    @classmethod
    def centred(cls, width: int, height: int, field_of_view: float) -> "Optics":
        """Square pixels, the principal point in the middle, ``field_of_view`` rad across the width."""
        focal = width / 2.0 / tan(field_of_view / 2.0)
        return cls(width, height, focal, focal, (width - 1) / 2.0, (height - 1) / 2.0)

    @classmethod
    def centred_deg(cls, width: int, height: int, field_of_view_deg: float) -> "Optics":
        """As ``centred``, from degrees."""
        return cls.centred(width, height, radians(field_of_view_deg))

    @property
    def whole(self) -> Window:
        """The window that is the whole image."""
        return Window(0, 0, self.width, self.height)

    def check(self, window: Window) -> None:
        """Raise ValueError when the window is empty or leaves the image."""
        inside = (
            window.left >= 0
            and window.top >= 0
            and window.width > 0
            and window.height > 0
            and window.left + window.width <= self.width
            and window.top + window.height <= self.height
        )
        if not inside:
            raise ValueError(f"{window} is not inside an image of {self.width} x {self.height} pixels")

    def rays(self, window: Window, samples: int = 1) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """X/Z of the columns and Y/Z of the rows, ``samples`` evenly in each pixel."""
        step = (np.arange(samples) + 0.5) / samples - 0.5
        columns = (np.arange(window.width)[:, None] + step).ravel() + window.left
        rows = (np.arange(window.height)[:, None] + step).ravel() + window.top
        return (columns - self.cx) / self.fx, (rows - self.cy) / self.fy

    def project(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """Pixels (..., 2) of points (..., 3) in camera axes; NaN behind the camera."""
        z = np.where(points[..., 2] > 0.0, points[..., 2], np.nan)
        return np.stack(
            [self.fx * points[..., 0] / z + self.cx, self.fy * points[..., 1] / z + self.cy], axis=-1
        )
