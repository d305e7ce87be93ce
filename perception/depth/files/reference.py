"""Ground truth from files: depth or disparity images, or arrays."""

from pathlib import Path
from zipfile import BadZipFile

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import OptionError

Field = NDArray[np.float32]


def read_reference(path: Path, scale: float, pixels_per_inverse_metre: float | None) -> Field:
    """The true inverse depth in 1/m, NaN where it is unknown (0 in the file).

    Args:
        path: an image of one channel, a .npy array, or a .npz file with the array `depth` or a single one.
        scale: the file's value of one metre, or of one pixel of disparity.
        pixels_per_inverse_metre: focal length × baseline when the file holds disparities, None when depths.

    Raises:
        OptionError: it cannot be read, or the scale is not positive.
    """
    for name, number in (("scale", scale), ("focal length times baseline", pixels_per_inverse_metre)):
        if number is not None and not (np.isfinite(number) and number > 0):
            raise OptionError(f"{path}: the reference's {name} is {number}, above 0 is needed")
    if path.suffix in (".npy", ".npz"):
        try:
            raw = np.load(path, allow_pickle=False)
            if isinstance(raw, np.lib.npyio.NpzFile):
                with raw:
                    raw = raw["depth"] if "depth" in raw.files or len(raw.files) != 1 else raw[raw.files[0]]
        except (OSError, ValueError, KeyError, EOFError, BadZipFile) as error:
            raise OptionError(f"{path}: cannot be read as an array ({error})") from error
    else:
        raw = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if raw is None or raw.ndim != 2:
        raise OptionError(f"{path}: no image of one channel")
    value = np.where(np.isfinite(raw) & (raw > 0), raw / scale, np.nan)
    inverse = 1 / value if pixels_per_inverse_metre is None else value / pixels_per_inverse_metre
    return np.asarray(inverse, np.float32)
