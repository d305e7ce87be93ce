"""Grey level and slope of a row between its pixels, low-passed in the same stroke.

h(x) = 2 f_c sinc(2 f_c x) cos²(πx/8), |x| < 4 px, f_c = .36 cycles a pixel, and its derivative h′. Sampled at any place
between the pixels, waves below .27 cycles a pixel keep their height, and what could pass for a wave beyond half a
cycle is so weak that the shift of a 1/f texture is read to 2·10⁻⁵ px whatever its fraction, of a ramp to .001 px. A
Gaussian as free of that error (σ .9) has a deviation a third greater.
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]

CUT_OFF = 0.36
REACH = 4
PARTS_BITS = 10
PARTS = 1 << PARTS_BITS
"""Places between two pixels that the table holds; half of one is .0005 px."""
TAPS = np.arange(1 - REACH, REACH + 1)
"""The pixels that a sample takes, counted from the one before it."""


def _low_pass(x: NDArray[np.float64]) -> NDArray[np.float64]:
    window = np.where(np.abs(x) < REACH, np.cos(np.pi * x / (2 * REACH)) ** 2, 0.0)
    return np.asarray(2 * CUT_OFF * np.sinc(2 * CUT_OFF * x) * window)


def _make_table() -> Field:
    """(PARTS, 16): the taps of h and h′ at every fraction; a constant and the slope of a ramp are exact."""
    x = TAPS - np.arange(PARTS)[:, None] / PARTS
    level = _low_pass(x)
    level /= level.sum(axis=1, keepdims=True)
    step = 1e-4
    slope = (_low_pass(x - step) - _low_pass(x + step)) / (2 * step)
    slope -= slope.sum(axis=1, keepdims=True) * level
    slope /= (slope * x).sum(axis=1, keepdims=True)
    return np.concatenate((level, slope), axis=1).astype(np.float32)


TABLE = _make_table()
LEVEL_TAPS = TABLE[0, :7].copy()
"""h at the pixels themselves."""
LEVEL_NOISE = float(np.mean(np.sum(TABLE[:, :8] ** 2, axis=1)))
"""Σ h², the part of the variance of white noise that a sample keeps."""


def sampling_matrix(places: Field, width: int) -> Field | None:
    """The matrix S (2m, width) that samples columns (width, rows) at m places: S @ columns is levels, then slopes.

    None when a pixel that a place needs is not there.

    Args:
        places: columns, ascending.
    """
    count = len(places)
    parts = np.rint(places * PARTS).astype(np.intp)
    first = (parts >> PARTS_BITS) + TAPS[0]
    if first[0] < 0 or first[-1] > width - len(TAPS):
        return None
    matrix = np.zeros(2 * count * width, np.float32)
    matrix[_taps_of(count, width) + first[:, None]] = TABLE[parts & (PARTS - 1)]
    return matrix.reshape(2 * count, width)


@lru_cache(maxsize=16)
def pixel_matrix(first: int, count: int, width: int) -> Field:
    """The matrix that samples columns (width, rows) at `count` of their own pixels from `first` on."""
    matrix = sampling_matrix(np.arange(first, first + count, dtype=np.float32), width)
    if matrix is None:
        raise ValueError(f"columns {first} to {first + count - 1} of {width} lack pixels to be sampled from")
    return matrix


@lru_cache(maxsize=16)
def _taps_of(count: int, width: int) -> NDArray[np.intp]:
    """(count, 16): where in the matrix the taps of every place stand that begins at column 0."""
    level = width * np.arange(count)[:, None] + np.arange(len(TAPS))
    return np.hstack((level, level + count * width))
