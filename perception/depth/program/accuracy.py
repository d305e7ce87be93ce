"""A depth map against ground truth."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth

Field = NDArray[np.float32]


@dataclass(frozen=True)
class Accuracy:
    """Figures over all pixels that have ground truth; a pixel without an estimate is counted as wrong."""

    density: float
    """Part of the pixels that have an estimate."""
    median_relative: float
    """Median of |Z − Z₀|/Z₀."""
    within_quarter: float
    """Part within 25 %."""
    inside_68: float
    inside_95: float
    """Part of the errors of 1/Z inside one and 1.96 stated standard deviations."""
    bad_1: float = float("nan")
    bad_2: float = float("nan")
    """Part whose disparity is wrong by more than 1 and 2 pixels, when a baseline was given."""


def compare(state: InverseDepth, truth: Field, pixels_per_inverse_metre: float | None = None) -> Accuracy:
    """Compare with the true inverse depth (NaN where it is unknown).

    Args:
        truth: 1/Z in 1/m, height × width.
        pixels_per_inverse_metre: focal length times baseline, so that the product with 1/Z is a disparity.

    Raises:
        ValueError: the sizes differ or nothing is known.
    """
    if truth.shape != state.value.shape:
        raise ValueError(
            f"the reference has {truth.shape[1]}×{truth.shape[0]} pixels,"
            f" the map {state.value.shape[1]}×{state.value.shape[0]}"
        )
    known = np.isfinite(truth) & (truth > 0)
    if not known.any():
        raise ValueError("the reference holds no depth")
    estimate, true, variance = state.value[known], truth[known], state.variance[known]
    there = np.isfinite(estimate)
    error = np.abs(estimate - true)
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.where(there, np.abs(true / np.maximum(estimate, 1e-12) - 1), np.inf)
        score = error[there] / np.sqrt(variance[there])
    bad = [float("nan"), float("nan")]
    if pixels_per_inverse_metre is not None:
        disparity = np.where(there, error * pixels_per_inverse_metre, np.inf)
        bad = [float(np.mean(disparity > limit)) for limit in (1.0, 2.0)]
    return Accuracy(
        float(there.mean()),
        float(np.median(relative)),
        float(np.mean(relative < 0.25)),
        float(np.mean(score < 1.0)) if there.any() else float("nan"),
        float(np.mean(score < 1.96)) if there.any() else float("nan"),
        bad[0],
        bad[1],
    )
