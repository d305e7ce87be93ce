"""The pinhole camera, thesis (2.1)–(2.5)."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import OptionError

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Pinhole:
    """Focal lengths and principal point in pixels: x_px = fx·X/Z + cx, thesis (2.4), (2.5).

    Raises:
        OptionError: a focal length is not positive.
    """

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise OptionError(f"{name} = {value}: a focal length in pixels is positive")

    @property
    def matrix(self) -> Matrix:
        """The 3×3 calibration matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def scaled(self, factor: float) -> "Pinhole":
        """The camera of the image resized by `factor`; pixel centres are at integers."""
        return Pinhole(
            self.fx * factor, self.fy * factor, (self.cx + 0.5) * factor - 0.5, (self.cy + 0.5) * factor - 0.5
        )

    @classmethod
    def guess(cls, width: int, height: int) -> "Pinhole":
        """A 60° lens with its axis in the middle, for images whose camera nobody measured."""
        focal = 0.5 * width / np.tan(np.radians(30.0))
        return cls(float(focal), float(focal), (width - 1) / 2, (height - 1) / 2)
