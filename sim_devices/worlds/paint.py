"""What a plan's surfaces are painted with: seeded pictures that tile, laid to scale."""

from functools import lru_cache
from pathlib import Path

import cv2
import numpy as np

from sim_devices.worlds.plan import TextureConfig
from sim_devices.worlds.texture import Texture, noise, plain

_TEXELS = 512
"""Of a pattern's period: 1.25 mm each on a wall by default."""
_BAR_TEXELS = 64
_POSTERS = 8


class Painter:
    """Textures to scale; what has none of its own gets the ``general`` one. The seed moves every pattern."""

    def __init__(self, general: TextureConfig, seed: int) -> None:
        self._general = general
        self._seed = seed
        self._places = np.random.default_rng((seed, 2))

    def anywhere(self, texture: TextureConfig | None) -> tuple[float, float]:
        """A place in the pattern, m: surfaces that share a picture show different parts of it."""
        across, down = ((texture or self._general).period * self._places.random(2)).tolist()
        return across, down

    def __call__(
        self,
        texture: TextureConfig | None,
        size: tuple[float, float],
        place: tuple[float, float] = (0.0, 0.0),
    ) -> Texture:
        """The texture on a rectangle of ``size`` m whose upper left corner shows that place of the pattern, m."""
        config = texture or self._general
        pattern = _pattern(config, self._seed)
        height, width = pattern.levels[0].shape
        if height == width == 1:
            return pattern
        across, down = config.period, config.period * height / width
        if config.kind == "stripes":
            return pattern.laid((size[0] / across, 1.0), (place[0] / across, 0.0))
        return pattern.laid((size[0] / across, size[1] / down), (place[0] / across, place[1] / down))


@lru_cache(maxsize=32)
def _pattern(config: TextureConfig, seed: int) -> Texture:
    """One period of it; the same for all surfaces that are painted alike."""
    match config.kind:
        case "noise":
            return noise(_TEXELS, config.seed + seed, mean=config.mean, contrast=40.0 * config.contrast)
        case "stripes":
            return _stripes(config.mean, 40.0 * config.contrast)
        case "posters":
            return _posters(config, np.random.default_rng((config.seed + seed, 1)))
        case "image":
            return _image(Path(config.file))
        case "bare":
            return plain(config.mean)


def _stripes(mean: float, deviation: float) -> Texture:
    """A dark and a light bar; each edge is two texels soft."""
    bars = np.where(np.arange(_BAR_TEXELS) < _BAR_TEXELS // 2, mean - deviation, mean + deviation)
    bars[[0, _BAR_TEXELS // 2]] = mean
    return Texture(np.clip(bars, 0.0, 255.0).astype(np.float32)[None, :])


def _posters(config: TextureConfig, rng: np.random.Generator) -> Texture:
    """Rectangles of noise, each with a grey of its own, on a wall that shows nothing else."""
    grain = noise(_TEXELS, int(rng.integers(2**31))).levels[0] - np.float32(128.0)
    pattern = np.zeros((_TEXELS, _TEXELS))
    for _ in range(_POSTERS):
        width, height = rng.integers(_TEXELS // 10, _TEXELS // 4, 2)
        rows = (np.arange(height) + rng.integers(_TEXELS)) % _TEXELS
        columns = (np.arange(width) + rng.integers(_TEXELS)) % _TEXELS
        part = np.ix_(rows, columns)
        pattern[part] = grain[part] + 40.0 * rng.standard_normal()
    pattern *= 40.0 * config.contrast / pattern.std()
    return Texture(np.clip(config.mean + pattern, 0.0, 255.0).astype(np.float32))


def _image(path: Path) -> Texture:
    picture = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)
    if picture is None:
        raise ValueError(f"{path} cannot be read as a picture")
    return Texture(np.asarray(picture, np.uint8))
