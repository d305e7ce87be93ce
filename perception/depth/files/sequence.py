"""The images of a sequence: a folder, a pattern, or a text file that lists them."""

from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import ImageError

SUFFIXES = {".png", ".jpg", ".jpeg", ".ppm", ".pgm", ".bmp", ".tif", ".tiff"}


def list_images(sequence: Path) -> list[Path]:
    """The images of a folder or of a pattern (`views/*.ppm`) in the order of their names, or those of a text file.

    The text file names one image a line, relative to itself; a time may precede it, as TUM RGB-D writes it.

    Raises:
        ImageError: there are fewer than two, or one that is named does not exist.
    """
    if sequence.is_dir():
        images = sorted(path for path in sequence.iterdir() if path.suffix.lower() in SUFFIXES)
        if not images and (sequence / "rgb").is_dir():
            return list_images(sequence / "rgb")
    elif sequence.suffix.lower() == ".txt" and sequence.is_file():
        images = _listed(sequence)
    elif any(sign in sequence.name for sign in "*?["):
        images = sorted(
            path for path in sequence.parent.glob(sequence.name) if path.suffix.lower() in SUFFIXES
        )
    else:
        raise ImageError(
            f"{sequence}: neither a folder of images, a pattern, nor a .txt file that lists them"
        )
    if len(images) < 2:
        raise ImageError(f"{sequence}: {len(images)} images; depth from motion needs two or more")
    return images


def _listed(index: Path) -> list[Path]:
    try:
        lines = [line.split("#")[0].strip() for line in index.read_text(encoding="utf-8-sig").splitlines()]
    except (OSError, UnicodeDecodeError) as error:
        raise ImageError(f"{index}: cannot be read ({error})") from error
    images = []
    for line in filter(None, lines):
        named = [index.parent / line, index.parent / line.split(maxsplit=1)[-1]]
        image = next((path for path in named if path.is_file()), None)
        if image is None:
            raise ImageError(f"{index}: {line} does not exist")
        images.append(image)
    return images


def read_image(path: Path) -> NDArray[np.uint8]:
    """An image as 8-bit grey (height × width) or colour (× 3, BGR); an equal-channelled one stays colour.

    Raises:
        ImageError: it cannot be read or has no 8 bits a channel.
    """
    image = cv2.imread(str(path), cv2.IMREAD_UNCHANGED)
    if image is None:
        raise ImageError(f"{path}: cannot be read as an image")
    if image.dtype != np.uint8:
        raise ImageError(f"{path}: {image.dtype.itemsize * 8} bits a channel, 8 are needed")
    if image.ndim == 3 and image.shape[2] == 4:
        image = image[..., :3]
    return np.asarray(image, np.uint8)
