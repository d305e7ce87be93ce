"""Regularisation by the thin membrane, thesis (2.12)–(2.18).

Ψ = Σ λ (u − d)²/σ² + Σ w (u_i − u_j)² over the pixels and over the pairs of neighbours (2.15). The
printed relaxation (2.16) minimises it with 4λ in the place of λ; here λ is that of (2.15).
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.select import select

Field = NDArray[np.float32]


@dataclass(frozen=True)
class Springs:
    """How strongly neighbours are tied: w of (x, y)–(x, y+1), height − 1 × width, and of (x, y)–(x+1, y)."""

    down: Field
    right: Field

    @classmethod
    def even(cls, shape: tuple[int, int]) -> "Springs":
        """The membrane of the thesis: all springs 1."""
        height, width = shape
        return cls(np.ones((height - 1, width), np.float32), np.ones((height, width - 1), np.float32))

    @classmethod
    def cut_at_edges(cls, guide: Field, contrast: float, disparity: Field, step_px: float) -> "Springs":
        """Springs that weaken across an edge of the image and all but tear at a step of the disparity."""

        def stiffness(axis: int) -> Field:
            edge = np.diff(guide, axis=axis) / np.float32(contrast)
            step = np.diff(disparity, axis=axis) / np.float32(step_px)
            return np.asarray(1 / ((1 + edge * edge) * (1 + np.square(step * step))) + 1e-4, np.float32)

        return cls(stiffness(0), stiffness(1))

    def gather(self, values: Field) -> Field:
        """Σ w u over the neighbours that there are."""
        total = np.zeros_like(values)
        vertical = np.empty_like(self.down)
        total[1:] += np.multiply(self.down, values[:-1], out=vertical)
        total[:-1] += np.multiply(self.down, values[1:], out=vertical)
        # The image as one long row, no spring between the end of a row and the next: twice as fast as row by row.
        row, springs = values.reshape(-1), self._right_of_all[:-1]
        along, horizontal = total.reshape(-1), np.empty_like(springs)
        along[1:] += np.multiply(springs, row[:-1], out=horizontal)
        along[:-1] += np.multiply(springs, row[1:], out=horizontal)
        return total

    @cached_property
    def _right_of_all(self) -> Field:
        height, width = self.right.shape
        padded = np.zeros((height, width + 1), np.float32)
        padded[:, :-1] = self.right
        return padded.reshape(-1)


def relax_membrane(
    measured: Field,
    variance: Field,
    springs: Springs,
    strength: float = 1.0,
    iterations: int = 20,
    start: Field | None = None,
) -> Field:
    """Relax the membrane over measured disparities, thesis (2.16), (2.17).

    u ← (Σ w ū + λσ⁻² d) / (Σ w + λσ⁻²), first on the black, then on the white squares of the chess-board
    (Gauss–Seidel).

    Args:
        measured: d, in pixels; NaN is a hole.
        variance: σ² of d in px²; it is not looked at in holes.
        strength: λ.
        start: where the relaxation begins; the measurement, with holes at its median, by default.

    Returns:
        u, height × width.
    """
    known = np.isfinite(measured)
    if start is None:
        middle = np.float32(np.median(measured[known])) if known.any() else np.float32(0)
        start = np.where(known, measured, middle)
    weight = _data_weight(known, variance, strength)
    share = 1 / (springs.gather(np.ones_like(weight)) + weight)
    pull = weight * select(known, measured, 0)
    height, width = measured.shape
    black = np.zeros((height, width), np.uint8)
    black[::2, 1::2] = black[1::2, ::2] = 1
    u = start.astype(np.float32, copy=True)
    for _ in range(iterations):
        for squares in (black, 1 - black):
            relaxed = springs.gather(u)
            relaxed += pull
            relaxed *= share
            cv2.copyTo(relaxed, squares, u)
    return u


def relaxed_variance(measured: Field, variance: Field, springs: Springs, strength: float = 1.0) -> Field:
    """The variance of the relaxed disparity by the corrected (2.18), (16 var ū + w² σ²)/(4 + w)².

    As in the thesis the neighbours' errors count as independent, var ū = Σ var/16. A hole has the worst
    variance there is.
    """
    known = np.isfinite(measured)
    weight = _data_weight(known, variance, strength)
    share = 1 / (springs.gather(np.ones_like(weight)) + weight)
    worst = np.float32(np.max(variance[known])) if known.any() else np.float32(0)
    spread = np.where(known, variance, worst).astype(np.float32)
    squared = Springs(springs.down * springs.down, springs.right * springs.right)
    return np.asarray((squared.gather(spread) + weight * weight * spread) * share * share, np.float32)


def _data_weight(known: NDArray[np.bool_], variance: Field, strength: float) -> Field:
    """λσ⁻², 0 in holes (footnote 3 of chapter 2)."""
    return select(known, np.float32(strength) / np.maximum(variance, np.float32(1e-6)), 0)
