"""The pinhole camera, thesis (2.1)–(2.5)."""

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import ConfigError

Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths and principal point in pixels: x_px = fx·X/Z + cx, thesis (2.4), (2.5)."""

    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        for name in ("fx", "fy"):
            value = getattr(self, name)
            if not (np.isfinite(value) and value > 0):
                raise ConfigError(f"{name} = {value}: a focal length in pixels is positive")

    @property
    def matrix(self) -> Matrix:
        """The 3×3 calibration matrix K."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def scaled(self, factor: float) -> "Intrinsics":
        """The camera of the picture resized by `factor`; pixel centres stand at integers."""
        return Intrinsics(
            self.fx * factor, self.fy * factor, (self.cx + 0.5) * factor - 0.5, (self.cy + 0.5) * factor - 0.5
        )

    @classmethod
    def guess(cls, width: int, height: int) -> "Intrinsics":
        """A 60° lens with its axis in the middle, for pictures whose camera nobody measured."""
        focal = 0.5 * width / np.tan(np.radians(30.0))
        return cls(float(focal), float(focal), (width - 1) / 2, (height - 1) / 2)


def read_intrinsics(path: Path) -> Intrinsics:
    """Read `fx fy cx cy` (pixels) from a TOML file, at its top or in a table `[camera]`.

    Raises:
        ConfigError: file, key and what is wrong with it.
    """
    try:
        content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not TOML ({error})") from error
    table = content.get("camera", content)
    if not isinstance(table, dict):
        raise ConfigError(f"{path}: [camera] must be a table")
    values = {}
    for key in ("fx", "fy", "cx", "cy"):
        value = table.get(key)
        if isinstance(value, bool) or not isinstance(value, int | float):
            raise ConfigError(f"{path}: {key} = {value!r}, a number of pixels is needed")
        values[key] = float(value)
    try:
        return Intrinsics(**values)
    except ConfigError as error:
        raise ConfigError(f"{path}: {error}") from error
