"""Tukey's weights, which leave out what is not the texture: another depth, a person, a reflection."""

import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]

TUKEY = 4.7
"""Residuals of more than this many deviations have no weight; 95 % efficient for normal ones."""
LEAST_NOISE = 0.2
"""Grey levels: what rounding to whole ones leaves after the filters."""


def weigh(rest: Field) -> tuple[Field, Field]:
    """The weight (1 − q)² and the slope of weight times residual, (1 − q)(1 − 5q) ≥ 0, q = (r/4.7 s)².

    s from the median |r| of every eighth pixel. Where that slope is negative it is left out: a step then goes the right
    way from afar, too.
    """
    some = np.sort(np.abs(rest[::2, ::4]), axis=None)
    deviation = max(1.4826 * float(some[len(some) // 2]), LEAST_NOISE)
    below = rest * rest
    below *= np.float32(-1 / (TUKEY * deviation) ** 2)
    below += np.float32(1)
    np.maximum(below, 0, out=below)
    bend = below * np.float32(5)
    bend -= np.float32(4)
    np.maximum(bend, 0, out=bend)
    bend *= below
    below *= below
    return below, bend
