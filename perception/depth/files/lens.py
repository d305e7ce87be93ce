"""The file of the camera that took the images, and its distortion taken out of them."""

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.depth.errors import OptionError
from perception.depth.geometry.pinhole import Pinhole

Image = NDArray[np.uint8]
NO_DISTORTION = (0.0,) * 5


def pinhole(lens: Intrinsics) -> Pinhole:
    """The camera whose images `undistort` gives."""
    return Pinhole(lens.fx, lens.fy, lens.cx, lens.cy)


def undistort(lens: Intrinsics, image: Image) -> Image:
    """The image as the pinhole would have taken it; one of another size as it is, for the estimator refuses it."""
    return lens.undistort(image) if image.shape[:2] == (lens.height, lens.width) else image


def read_lens(path: Path, size: tuple[int, int]) -> Intrinsics:
    """Read `fx fy cx cy` (pixels), and `distortion` and `width height` if they are there, from a TOML file.

    At the top of the file or in a table `[camera]`.

    Args:
        size: width and height of the images, pixels; those of the file must be the same.

    Raises:
        OptionError: file, key and what is wrong with it.
    """
    try:
        content: dict[str, Any] = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise OptionError(f"{path}: cannot be read ({error.strerror})") from error
    except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
        raise OptionError(f"{path}: not TOML ({error})") from error
    table = content.get("camera", content)
    if not isinstance(table, dict):
        raise OptionError(f"{path}: [camera] must be a table")
    for key, pixels in zip(("width", "height"), size, strict=True):
        if table.get(key, pixels) != pixels:
            raise OptionError(f"{path}: {key} = {table[key]!r}, the images have {size[0]}×{size[1]} pixels")
    fx, fy, cx, cy = (
        _number(path, key, table.get(key), "a number of pixels") for key in ("fx", "fy", "cx", "cy")
    )
    coefficients = table.get("distortion", list(NO_DISTORTION))
    if not isinstance(coefficients, list) or len(coefficients) != len(NO_DISTORTION):
        raise OptionError(
            f"{path}: distortion = {coefficients!r}, five numbers k1, k2, p1, p2, k3 are needed"
        )
    k1, k2, p1, p2, k3 = (_number(path, "distortion", value, "a number") for value in coefficients)
    try:
        Pinhole(fx, fy, cx, cy)
    except OptionError as error:
        raise OptionError(f"{path}: {error}") from error
    return Intrinsics(*size, fx, fy, cx, cy, (k1, k2, p1, p2, k3))


def _number(path: Path, key: str, value: object, wanted: str) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise OptionError(f"{path}: {key} = {value!r}, {wanted} is needed")
    return float(value)
