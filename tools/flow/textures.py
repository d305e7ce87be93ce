"""Images of a 1/f texture moved to the right by any part of a pixel, exactly.

The texture is a Fourier series on a grid twice as fine as the pixels of a 256×256 image. It is moved by its phases,
softened by a lens (σ .5 px) and averaged over the area of each pixel, all in the spectrum: no image is interpolated.
What the pixels cannot resolve folds back, as in a camera.
"""

import numpy as np
from numpy.typing import NDArray

Levels = NDArray[np.float64]
Image = NDArray[np.uint8]

SIDE = 256
FINE = 2
LENS_PX = 0.5
CONTRAST = 40.0
"""Grey levels of standard deviation at contrast 1, over the whole image."""
MEAN = 128.0
NOISE = 2.0


class Texture:
    """A 1/f texture, standard deviation 1, of which `rows` rows are kept.

    Args:
        lens_px: σ of the lens's blur; 0 gives a texture with all that the pixels can hold, and folding.
    """

    def __init__(self, seed: int, rows: int = 96, lens_px: float = LENS_PX) -> None:
        count = SIDE * FINE
        spectrum = np.fft.rfft2(np.random.default_rng(seed).standard_normal((count, count)))
        down, self._across = np.fft.fftfreq(count)[:, None] * FINE, np.fft.rfftfreq(count)[None] * FINE
        radius = np.hypot(down, self._across)
        radius[0, 0] = 1
        spectrum *= (
            np.sinc(down) * np.sinc(self._across) * np.exp(-2 * (np.pi * lens_px * radius) ** 2) / radius
        )
        spectrum[0, 0] = 0
        spectrum /= np.fft.irfft2(spectrum, (count, count))[::FINE, ::FINE].std()
        self._rows = np.fft.ifft(spectrum, axis=0)[: rows * FINE : FINE]

    def moved(self, shift_px: float) -> Levels:
        """(rows, 256), moved to the right."""
        moved = np.fft.irfft(self._rows * np.exp(-2j * np.pi * self._across * shift_px), SIDE * FINE, axis=1)
        return np.asarray(moved[:, ::FINE], np.float64)


def sense(light: Levels, random: np.random.Generator, noise: float = NOISE) -> Image:
    """What a camera of 8 bits makes of the light on its pixels: noise, whole grey levels, 0 to 255."""
    return np.clip(np.rint(light + random.normal(0, noise, light.shape)), 0, 255).astype(np.uint8)
