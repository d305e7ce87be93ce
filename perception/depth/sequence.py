"""The pictures of a sequence: a folder, or a text file that lists them."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import ImageError

SUFFIXES = {".png", ".jpg", ".jpeg", ".ppm", ".pgm", ".bmp", ".tif", ".tiff"}


def list_pictures(sequence: Path) -> list[Path]:
    """The pictures of a folder in the order of their names, or those a text file names, one a line.

    Raises:
        ImageError: there are fewer than two, or one that is named does not exist.
    """
    if sequence.is_dir():
        pictures = sorted(path for path in sequence.iterdir() if path.suffix.lower() in SUFFIXES)
        if not pictures and (sequence / "rgb").is_dir():
            return list_pictures(sequence / "rgb")
    elif sequence.suffix.lower() == ".txt" and sequence.is_file():
        lines = [line.split("#")[0].strip() for line in sequence.read_text(encoding="utf-8").splitlines()]
        pictures = [sequence.parent / line for line in lines if line]
        for picture in pictures:
            if not picture.is_file():
                raise ImageError(f"{sequence}: {picture.name} does not exist")
    else:
        raise ImageError(f"{sequence}: neither a folder of pictures nor a .txt file that lists them")
    if len(pictures) < 2:
        raise ImageError(f"{sequence}: {len(pictures)} pictures; depth from motion needs two or more")
    return pictures


def read_picture(path: Path) -> NDArray[np.uint8]:
    """A picture as 8-bit grey (height × width) or colour (× 3, BGR); an equal-channelled one stays colour.

    Raises:
        ImageError: it cannot be read or has no 8 bits a channel.
    """
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ImageError(f"{path}: cannot be read as a picture")
    if image.dtype != np.uint8:
        raise ImageError(f"{path}: {image.dtype.itemsize * 8} bits a channel, 8 are needed")
    if image.ndim == 3 and image.shape[2] == 4:
        image = image[..., :3]
    return np.asarray(image, np.uint8)
