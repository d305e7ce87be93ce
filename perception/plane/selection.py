"""Which blocks of a window move with the plane.

What stands before a plane covers whole blocks, and a block's mean square residual tells far more than a pixel's. As
the residual of a block is quadratic in the unknowns, a hypothesis is tried on all blocks without another warp.
"""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from math import sqrt

import numpy as np
from numpy.typing import NDArray

Matrix = NDArray[np.float64]
Mask = NDArray[np.bool_]
ROOT = 1.2
"""A block counts fully up to this many times the root mean square residual of its peers."""
SPREAD = 16.0
"""It counts nothing from 1 + SPREAD/√pixels times their mean square on, 3 at 64 pixels."""
AGREEING = 0.33
"""Part of the blocks that a hypothesis is judged by: those that it explains best."""
CANDIDATES = 4
CONCENTRATIONS = 3
LEAST = 0.15
"""Part of the blocks that is kept at least, however bad."""
LEAST_VARIANCE = 0.1
"""Of the residual, grey²: images of whole grey levels agree no better."""
OFFSET_GREY = 1.0
"""Standard deviation of what a block's own offset may be, grey levels."""
RIDGE = 1e-6
"""Of a normal matrix's diagonal: an unknown that nothing is known of stays 0."""


@dataclass(frozen=True)
class Equations:
    """Least squares of each block: JᵀJ (a row each), Jᵀr and rᵀr, of as many pixels each; and which blocks are seen.

    The last unknown is an offset.
    """

    gram: Matrix
    right: Matrix
    energy: Matrix
    pixels: int
    seen: Mask
    tolerance: Matrix
    """Mean square residual of each block that a shift within the tolerance leaves."""

    @cached_property
    def number(self) -> int:
        """Blocks that are seen."""
        return int(self.seen.sum())

    def normal(self, weights: Matrix) -> Matrix:
        """Weighted sums of the Gram matrices, … × p × p for weights … × blocks."""
        unknowns = self.right.shape[1]
        normal = (weights @ self.gram).reshape(*weights.shape[:-1], unknowns, unknowns)
        diagonal = np.einsum("...ii->...i", normal)
        diagonal += RIDGE * (diagonal + 1)
        return normal

    def solve(self, weights: Matrix) -> Matrix:
        """Solutions … × p for weights … × blocks."""
        return np.asarray(np.linalg.solve(self.normal(weights), (weights @ self.right)[..., None])[..., 0])

    def residual(self, solution: Matrix) -> Matrix:
        """Mean square residual of every block under solutions … × p, … × blocks."""
        squares = (solution[..., :, None] * solution[..., None, :]).reshape(*solution.shape[:-1], -1)
        return (self.energy - 2 * solution @ self.right.T + squares @ self.gram.T) / self.pixels

    def with_own_offsets(self) -> "Equations":
        """The same with an offset for each block, which is eliminated: what is left of light that falls unevenly."""
        unknowns = self.right.shape[1]
        sums, total = self.gram[:, -unknowns:], self.right[:, -1]
        held = 1 / (self.pixels + 1 / OFFSET_GREY**2)
        return replace(
            self,
            gram=self.gram - held * (sums[:, :, None] * sums[:, None, :]).reshape(len(sums), -1),
            right=self.right - held * total[:, None] * sums,
            energy=self.energy - held * total * total,
        )


@dataclass(frozen=True)
class Selection:
    """The solution and the weights of the blocks, 0 to 1, that it was found with; and the weights that follow of it."""

    solution: Matrix
    weights: Matrix
    residual: Matrix
    """Mean square residual of every block."""
    variance: float
    """Of the blocks that agree."""
    following: Matrix

    @property
    def agreeing(self) -> float:
        """How many blocks agree, each as much as it counts."""
        return float(self.following.sum())


def select_blocks(equations: Equations) -> Selection:
    """The solution of most blocks: weights from the residuals of all, then solved once more with them."""
    residual = equations.residual(equations.solve(equations.seen.astype(float)))
    return _reweigh_best(equations, residual, 0.55, 1.3)


def reweigh(equations: Equations, weights: Matrix) -> Selection:
    """The solution with these weights and the weights that follow of it."""
    weights = weights * equations.seen
    solution = equations.solve(weights)
    residual = equations.residual(solution)
    variance = _middle(residual[weights > 0.1])
    return Selection(solution, weights, residual, variance, _weigh(equations, residual, variance))


def search_blocks(equations: Equations, columns: int, known: Selection) -> Selection:
    """The solution on which most blocks agree: least trimmed squares, started from parts of the window.

    Args:
        columns: blocks in a row of the window.
        known: a solution that is tried too.
    """
    parts = _parts(columns, len(equations.seen) // columns) * equations.seen
    parts = parts[parts.sum(axis=1) >= 3]
    agreeing, cost = _agreeing(
        equations, np.vstack((equations.residual(equations.solve(parts)), known.residual))
    )
    agreeing = agreeing[np.argsort(cost)[:CANDIDATES]]
    for _ in range(CONCENTRATIONS):
        residuals = equations.residual(equations.solve(agreeing))
        agreeing, cost = _agreeing(equations, residuals)
    return _reweigh_best(equations, residuals[int(np.argmin(cost))], AGREEING, 1.35)


def _reweigh_best(equations: Equations, residual: Matrix, part: float, rise: float) -> Selection:
    """Weights from the blocks that agree best, whose residual lies by the factor `rise` below that of all that do."""
    variance = rise * _middle(residual[_lowest(equations, residual, part)])
    return reweigh(equations, _weigh(equations, residual, variance))


def _weigh(equations: Equations, residual: Matrix, variance: float) -> Matrix:
    width = sqrt(1 + SPREAD / sqrt(equations.pixels)) - ROOT
    excess = np.sqrt(np.maximum(residual, 0) / (variance + equations.tolerance))
    excess = np.maximum(excess - ROOT, 0) / width
    weights = np.maximum(1 - excess * excess, 0)
    weights *= weights
    weights *= equations.seen
    if weights.sum() < LEAST * equations.number:
        return _lowest(equations, residual, 2 * LEAST).astype(float)
    return weights


def _middle(residual: Matrix) -> float:
    return max(float(np.sort(residual)[len(residual) // 2]), LEAST_VARIANCE)


def _lowest(equations: Equations, residual: Matrix, part: float) -> Mask:
    shown = np.where(equations.seen, residual, np.inf)
    return np.asarray(shown <= np.sort(shown)[max(int(part * equations.number) - 1, 0)])


def _agreeing(equations: Equations, residuals: Matrix) -> tuple[Matrix, Matrix]:
    """The blocks each hypothesis explains best, and their mean square residual."""
    number = max(int(AGREEING * equations.number), 3)
    shown = np.where(equations.seen, residuals, np.inf)
    best = np.argpartition(shown, number, axis=1)[:, :number]
    chosen = np.zeros_like(residuals)
    np.put_along_axis(chosen, best, 1.0, axis=1)
    return chosen, np.take_along_axis(shown, best, axis=1).mean(axis=1)


@cache
def _parts(columns: int, rows: int) -> Matrix:
    """Parts of the window to start from: ninths, halves, three quarters, rim, sides and ends."""
    x, y = np.meshgrid((np.arange(columns) + 0.5) / columns, (np.arange(rows) + 0.5) / rows)
    ninth = (3 * y).astype(int) * 3 + (3 * x).astype(int)
    parts = [ninth == i for i in range(9)]
    halves = [x < 0.5, x > 0.5, y < 0.5, y > 0.5]
    parts += halves
    parts += [~(across & down) for across in halves[:2] for down in halves[2:]]
    parts += [np.maximum(np.abs(x - 0.5), np.abs(y - 0.5)) > 0.28]
    parts += [np.abs(x - 0.5) > 0.25, np.abs(y - 0.5) > 0.25, x < 0.4, x > 0.6, y < 0.4, y > 0.6]
    return np.array([part.ravel() for part in parts], float)
