"""Images that are known between their pixels: sums of plane waves, moved by a homography without any warp."""

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

Image = NDArray[np.uint8]
Matrix = NDArray[np.float64]
Waves = Callable[..., Image]


def paint(
    homography: Matrix,
    seed: int = 1,
    side: int = 128,
    contrast: float = 40.0,
    noise: float = 0.0,
    light: float | NDArray[np.float64] = 1.0,
    shortest: float = 6.0,
) -> Image:
    """What stands at H⁻¹ x of a pattern with wave lengths from `shortest` to 60 px: the second image of a pair.

    The pattern is the sum of 40 cosines, evaluated at every pixel: there is nothing to interpolate or to alias.
    """
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(shortest), np.log(60), 40))
    angle, phase = rng.uniform(0, 2 * np.pi, 40), rng.uniform(0, 2 * np.pi, 40)
    x, y = np.meshgrid(np.arange(side, dtype=float), np.arange(side, dtype=float))
    back = np.linalg.inv(homography) @ np.stack((x.ravel(), y.ravel(), np.ones(x.size)))
    px, py = back[0] / back[2], back[1] / back[2]
    grey = np.zeros(x.size)
    for k in range(40):
        grey += np.cos(2 * np.pi / length[k] * (np.cos(angle[k]) * px + np.sin(angle[k]) * py) + phase[k])
    pattern = 128 + contrast * grey.reshape(side, side) / np.sqrt(20)
    # Each view has noise of its own.
    drawn = np.random.default_rng([seed, int(1e9 * np.abs(homography).sum()) % 2**32])
    shown = light * pattern + drawn.normal(0, noise, (side, side))
    return np.clip(np.rint(shown), 0, 255).astype(np.uint8)


@pytest.fixture(scope="session")
def waves() -> Waves:
    """`paint`, for the tests of this folder."""
    return paint
