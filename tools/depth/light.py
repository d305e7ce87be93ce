"""Changes of the light between images, as the issue lists them."""

from collections.abc import Callable

import numpy as np

from tools.depth.real_images import Image

Light = Callable[[Image, int], Image]
"""Image and its number in the sequence to the image as it would have been exposed."""


def _expose(grey: np.ndarray[tuple[int, ...], np.dtype[np.float64]]) -> Image:
    return np.clip(np.rint(grey), 0, 255).astype(np.uint8)


def steady(image: Image, number: int) -> Image:
    """Nothing changes."""
    return image


def gain_and_offset(image: Image, number: int) -> Image:
    """Every second image times .6 plus 20."""
    return image if number % 2 == 0 else _expose(0.6 * image.astype(float) + 20)


def vignette(image: Image, number: int) -> Image:
    """Every image falls to half its light in the corners."""
    height, width = image.shape[:2]
    y, x = np.mgrid[0:height, 0:width].astype(float)
    radius = ((x - width / 2) ** 2 + (y - height / 2) ** 2) / ((width / 2) ** 2 + (height / 2) ** 2)
    gain = 1 - 0.5 * radius
    return _expose(image * (gain if image.ndim == 2 else gain[..., None]))


FLICKER = (1.0, 0.7, 1.3, 0.85, 1.15, 0.7, 1.3, 1.0, 0.75, 1.25, 0.9, 1.1)


def flicker(image: Image, number: int) -> Image:
    """The gain of each image differs, up to ±30 %."""
    return _expose(FLICKER[number % len(FLICKER)] * image.astype(float))


LIGHTS: dict[str, Light] = {
    "none": steady,
    "gain .6 + 20": gain_and_offset,
    "vignette": vignette,
    "flicker ±30 %": flicker,
}


def dim(image: Image, seed: int) -> Image:
    """Contrast × .15 with noise of σ = 2 grey levels."""
    rng = np.random.default_rng(seed)
    return _expose(0.15 * image.astype(float) + rng.normal(0.0, 2.0, image.shape))
