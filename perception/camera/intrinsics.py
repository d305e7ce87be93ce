"""A camera's intrinsics: pixels to rays and back, lens distortion, and the TOML file they live in."""

import tomllib
from dataclasses import asdict, dataclass
from functools import cached_property
from math import isfinite
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.errors import IntrinsicsError
from perception.camera.frame import Image

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Intrinsics:
    """Focal lengths and principal point in pixels, Brown distortion (k1, k2, p1, p2, k3).

    The centre of the upper left pixel is (0, 0); x right, y down.

    Raises:
        IntrinsicsError: a size or focal length is not positive, or a number not finite.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, float, float, float, float] = (0.0, 0.0, 0.0, 0.0, 0.0)

    def __post_init__(self) -> None:
        if self.width < 1 or self.height < 1:
            raise IntrinsicsError(f"image size {self.width} x {self.height} must be at least 1 x 1")
        if not (self.fx > 0.0 and self.fy > 0.0):
            raise IntrinsicsError(f"focal lengths {self.fx}, {self.fy} px must be positive")
        if not all(isfinite(v) for v in (self.fx, self.fy, self.cx, self.cy, *self.distortion)):
            raise IntrinsicsError("intrinsics must be finite numbers")

    @property
    def matrix(self) -> Array:
        """The 3 x 3 camera matrix."""
        return np.array([[self.fx, 0.0, self.cx], [0.0, self.fy, self.cy], [0.0, 0.0, 1.0]])

    def rays(self, pixels: Array) -> Array:
        """X/Z and Y/Z (..., 2) of distorted pixels (..., 2); NaN stays NaN."""
        pixels = np.asarray(pixels, float)
        if not any(self.distortion):
            return (pixels - (self.cx, self.cy)) / (self.fx, self.fy)
        flat = np.nan_to_num(pixels.reshape(-1, 1, 2))
        rays = cv2.undistortPoints(flat, self.matrix, np.array(self.distortion)).reshape(pixels.shape)
        return np.where(np.isnan(pixels), np.nan, rays)

    def scaled(self, width: int, height: int) -> "Intrinsics":
        """The intrinsics of the image resized to `width` x `height`, its pixels' outer edges kept."""
        sx, sy = width / self.width, height / self.height
        return Intrinsics(
            width,
            height,
            self.fx * sx,
            self.fy * sy,
            (self.cx + 0.5) * sx - 0.5,
            (self.cy + 0.5) * sy - 0.5,
            self.distortion,
        )

    @cached_property
    def _undistortion(self) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        maps = cv2.initUndistortRectifyMap(
            self.matrix,
            np.array(self.distortion),
            np.eye(3),
            self.matrix,
            (self.width, self.height),
            cv2.CV_32FC1,
        )
        return np.asarray(maps[0], np.float32), np.asarray(maps[1], np.float32)

    def undistort(self, image: Image) -> Image:
        """The image as the same camera without distortion would give it.

        Raises:
            IntrinsicsError: the image has another size.
        """
        if image.shape[:2] != (self.height, self.width):
            raise IntrinsicsError(
                f"intrinsics of {self.width} x {self.height} pixels do not fit an image of "
                f"{image.shape[1]} x {image.shape[0]}"
            )
        if not any(self.distortion):
            return image
        straight = cv2.remap(image, *self._undistortion, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
        return np.asarray(straight, np.uint8)


def load_intrinsics(path: Path, table: str = "") -> Intrinsics:
    """Intrinsics from a TOML file, or from one of its tables.

    Raises:
        IntrinsicsError: what is missing or wrong, with file, key and value.
    """
    try:
        data = tomllib.loads(path.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise IntrinsicsError(f"{path}: {error}") from error
    where = f"{path}: [{table}]" if table else str(path)
    content = data.get(table) if table else data
    if not isinstance(content, dict):
        raise IntrinsicsError(f"{where} is missing")
    values: dict[str, float] = {}
    for key in ("width", "height", "fx", "fy", "cx", "cy"):
        values[key] = _number(content.get(key), f"{where} {key}")
    distortion = content.get("distortion", [0.0] * 5)
    if not isinstance(distortion, list) or len(distortion) != 5:
        raise IntrinsicsError(
            f"{where} distortion must be five numbers k1, k2, p1, p2, k3, not {distortion!r}"
        )
    k1, k2, p1, p2, k3 = (_number(v, f"{where} distortion") for v in distortion)
    for key in ("width", "height"):
        if values[key] != int(values[key]):
            raise IntrinsicsError(f"{where} {key} must be a whole number of pixels, not {values[key]}")
    return Intrinsics(
        int(values["width"]),
        int(values["height"]),
        values["fx"],
        values["fy"],
        values["cx"],
        values["cy"],
        (k1, k2, p1, p2, k3),
    )


def format_intrinsics(intrinsics: Intrinsics, table: str = "") -> str:
    """The TOML text of intrinsics, under `table` when one is given."""
    lines = [f"[{table}]"] if table else []
    for key, value in asdict(intrinsics).items():
        if isinstance(value, tuple):
            lines.append(f"{key} = [{', '.join(repr(float(v)) for v in value)}]")
        else:
            lines.append(f"{key} = {value!r}")
    return "\n".join(lines) + "\n"


def _number(value: object, what: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise IntrinsicsError(f"{what} must be a number, not {value!r}")
    return float(value)
