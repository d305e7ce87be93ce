"""Regularisation by the thin membrane, thesis (2.12)–(2.18).

Ψ = Σ λ (u − d)²/σ² + Σ w (u_i − u_j)² over the pixels and over the pairs of neighbours (2.15). The
printed relaxation (2.16) minimises it with 4λ in the place of λ; here λ is that of (2.15).
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

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
    def cut_at_edges(cls, guide: Field, contrast: float, disparity: Field, jump_px: float) -> "Springs":
        """Springs that weaken across an edge of the picture and all but tear at a jump of the disparity."""

        def stiffness(axis: int) -> Field:
            edge = np.diff(guide, axis=axis) / np.float32(contrast)
            jump = np.diff(disparity, axis=axis) / np.float32(jump_px)
            return np.asarray(1 / ((1 + edge * edge) * (1 + np.square(jump * jump))) + 1e-4, np.float32)

        return cls(stiffness(0), stiffness(1))

    def gather(self, values: Field) -> Field:
        """Σ w u over the neighbours that there are."""
        total = np.zeros_like(values)
        total[1:] += self.down * values[:-1]
        total[:-1] += self.down * values[1:]
        total[:, 1:] += self.right * values[:, :-1]
        total[:, :-1] += self.right * values[:, 1:]
        return total


def relax_membrane(
    measured: Field,
    variance: Field,
    springs: Springs,
    strength: float = 1.0,
    iterations: int = 20,
    start: Field | None = None,
    independent: bool = False,
) -> tuple[Field, Field]:
    """Relax the membrane over measured disparities, thesis (2.16)–(2.18), and carry the variance along.

    u ← (Σ w ū + λσ⁻² d) / (Σ w + λσ⁻²), first on the black, then on the white squares of the chess-board
    (Gauss–Seidel). The variance follows the corrected (2.18), (16 var ū + w² σ²)/(4 + w)², w = λσ⁻².

    Args:
        measured: d, in pixels; NaN is a void.
        variance: σ² of d in px²; it is not looked at in voids.
        strength: λ.
        start: where the relaxation begins; the measurement, with voids at its median, by default.
        independent: whether the neighbours' errors are independent, var ū = Σ var/16, as the thesis has it. The
            windows of neighbours overlap, so by default they are taken to err together.
        independent: var ū = Σ w² σ²/(Σ w)², errors independent, as (2.18) supposes. Overlapping windows make
            neighbours err together; so by default all deviations are added as they are.

    Returns:
        u and its variance, height × width each.
    """
    known = np.isfinite(measured)
    data = np.where(known, measured, np.float32(0))
    weight = np.where(known, np.float32(strength) / np.maximum(variance, np.float32(1e-6)), 0).astype(
        np.float32
    )
    if start is None:
        middle = np.float32(np.median(measured[known])) if known.any() else np.float32(0)
        start = np.where(known, measured, middle)
    ties = springs.gather(np.ones_like(data))
    share = 1 / (ties + weight)
    height, width = data.shape
    black = (np.add.outer(np.arange(height), np.arange(width)) & 1).astype(bool)
    u = start.astype(np.float32, copy=True)
    pull = weight * data
    for _ in range(iterations):
        for squares in (black, ~black):
            np.copyto(u, (springs.gather(u) + pull) * share, where=squares)
    worst = np.float32(np.max(variance[known])) if known.any() else np.float32(0)
    spread = np.where(known, variance, worst).astype(np.float32)
    if independent:
        squared = Springs(springs.down * springs.down, springs.right * springs.right)
        return u, np.asarray((squared.gather(spread) + weight * weight * spread) * share * share, np.float32)
    deviation = np.sqrt(spread)
    mixed = (springs.gather(deviation) + weight * deviation) * share
    return u, np.asarray(mixed * mixed, np.float32)
