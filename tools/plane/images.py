"""Images whose truth is exact: worlds rendered four times as fine, averaged over the pixels' areas, and exposed.

Nothing of the estimators' own warps is in them.
"""

from functools import cache
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.render import render
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.texture import noise as noise_texture
from sim_devices.worlds.world import World

DATA = Path(__file__).resolve().parents[3] / "shared" / "data"
FINE = 4
"""With twice as many samples the images change by .09 grey levels."""

Image = NDArray[np.uint8]
Field = NDArray[np.float32]


def square_optics(side: int, focal: float) -> Optics:
    """A camera of side × side pixels with its principal point in the middle."""
    return Optics(side, side, focal, focal, (side - 1) / 2, (side - 1) / 2)


def look(world: World, optics: Optics, camera: Placement) -> Field:
    """What a camera sees, grey levels before noise and rounding."""
    fine = Optics(
        optics.width * FINE,
        optics.height * FINE,
        optics.fx * FINE,
        optics.fy * FINE,
        (optics.cx + 0.5) * FINE - 0.5,
        (optics.cy + 0.5) * FINE - 0.5,
    )
    image = render(world, fine, camera, 0.0)
    return np.asarray(
        cv2.resize(image, (optics.width, optics.height), interpolation=cv2.INTER_AREA), np.float32
    )


def expose(light: NDArray[np.floating], noise: float, rng: np.random.Generator) -> Image:
    """Whole grey levels of 8 bits with Gaussian noise."""
    return np.clip(np.rint(light + rng.normal(0, noise, light.shape)), 0, 255).astype(np.uint8)


def read_grey(name: str) -> Image | None:
    """An image of ../shared/data, None where it is absent."""
    path = DATA / name
    image = cv2.imread(str(path), cv2.IMREAD_GRAYSCALE) if path.is_file() else None
    return None if image is None else np.asarray(image, np.uint8)


@cache
def texture_of(name: str, repeat: int = 1, mirrored: bool = False) -> Texture:
    """A texture by name: an image of ../shared/data, or `noise SEED CONTRAST`.

    Args:
        mirrored: laid beside its mirror images first, so that no seams show.

    Raises:
        FileNotFoundError: the image is absent.
    """
    tiles = (float(repeat), float(repeat))
    if name.startswith("noise"):
        _, seed, contrast = name.split()
        return noise_texture(1024, int(seed), contrast=float(contrast), repeat=tiles)
    image = read_grey(name)
    if image is None:
        raise FileNotFoundError(DATA / name)
    if mirrored:
        wide = np.hstack((image, image[:, ::-1]))
        image = np.vstack((wide, wide[::-1]))
    return Texture(image, repeat=tiles)
