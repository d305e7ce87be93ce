"""Textures: grey pictures with their mip levels, and seeded patterns to paint surfaces with."""

from dataclasses import dataclass, field, replace

import cv2
import numpy as np
from numpy.typing import NDArray

Grey = NDArray[np.float32]


@dataclass(frozen=True, eq=False)
class Texture:
    """A grey picture, 0 to 255, with each level half the size of the one before (area means).

    A surface shows it ``repeat`` times across and down; its upper left corner shows the place ``offset`` of
    the picture, in pictures.
    """

    picture: NDArray[np.uint8] | Grey
    repeat: tuple[float, float] = (1.0, 1.0)
    offset: tuple[float, float] = (0.0, 0.0)
    levels: tuple[Grey, ...] = field(default=(), repr=False)

    def __post_init__(self) -> None:
        if self.picture.ndim != 2 or min(self.picture.shape) < 1:
            raise ValueError(f"a texture is a grey picture (height, width), got shape {self.picture.shape}")
        if self.levels:
            return
        level = np.ascontiguousarray(self.picture, dtype=np.float32)
        levels = [level]
        while max(level.shape) > 1:
            height, width = max(1, level.shape[0] // 2), max(1, level.shape[1] // 2)
            level = np.ascontiguousarray(cv2.resize(level, (width, height), interpolation=cv2.INTER_AREA))
            levels.append(level.astype(np.float32, copy=False))
        object.__setattr__(self, "levels", tuple(levels))

    @property
    def tiled(self) -> bool:
        """Whether the picture is laid side by side."""
        return self.repeat != (1.0, 1.0) or self.offset != (0.0, 0.0)

    def laid(self, repeat: tuple[float, float], offset: tuple[float, float] = (0.0, 0.0)) -> "Texture":
        """The same picture and levels, laid otherwise."""
        return replace(self, repeat=repeat, offset=offset)


def plain(grey: float) -> Texture:
    """One grey level everywhere."""
    return Texture(np.full((1, 1), grey, np.float32))


def noise(
    size: int,
    seed: int,
    *,
    mean: float = 128.0,
    contrast: float = 40.0,
    finest: float = 2.0,
    repeat: tuple[float, float] = (1.0, 1.0),
) -> Texture:
    """Random pattern with equal energy in every octave down to ``finest`` texels; it tiles.

    ``contrast`` is the standard deviation in grey levels; values are cut at 0 and 255.
    """
    rng = np.random.default_rng(seed)
    spectrum = np.fft.rfft2(rng.standard_normal((size, size)))
    fy, fx = np.fft.fftfreq(size)[:, None], np.fft.rfftfreq(size)[None, :]
    radius = np.hypot(fx, fy)
    radius[0, 0] = 1.0
    shape = np.exp(-((radius * finest) ** 2) * 2.0) / radius
    shape[0, 0] = 0.0
    pattern = np.fft.irfft2(spectrum * shape, (size, size))
    pattern *= contrast / pattern.std()
    return Texture(np.clip(pattern + mean, 0.0, 255.0).astype(np.float32), repeat)


def checker(squares: tuple[int, int], cell: int = 16, dark: float = 30.0, light: float = 220.0) -> Texture:
    """A board of (columns, rows) squares of ``cell`` texels, the one at the upper left dark."""
    columns, rows = squares
    odd = (np.add.outer(np.arange(rows), np.arange(columns)) & 1).astype(np.float32)
    board = dark + (light - dark) * odd
    return Texture(np.kron(board, np.ones((cell, cell), np.float32)).astype(np.float32))


def disc(size: int = 256, light: float = 250.0, dark: float = 20.0, radius: float = 0.7) -> Texture:
    """A light disc on a dark square; ``radius`` in half sides, its rim two texels soft."""
    axis = (np.arange(size) + 0.5) / size * 2.0 - 1.0
    distance = np.hypot(axis[:, None], axis[None, :])
    cover = np.clip((radius - distance) * size / 4.0 + 0.5, 0.0, 1.0)
    return Texture((dark + (light - dark) * cover).astype(np.float32))
