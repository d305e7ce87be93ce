"""The recursive filter: inverse depth and its variance, pixel by pixel, thesis (2.23)–(2.28).

In Z the observation d = C/Z + D must be linearised, and from a distant start the filter of the thesis
leaves for negative depths. In ρ = 1/Z the observation is linear, so the gain needs no linearisation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.depth.epipolar import Projection

Field = NDArray[np.float32]


@dataclass(frozen=True)
class InverseDepth:
    """ρ in 1/m and its variance P in 1/m²; NaN where nothing is known; height × width."""

    value: Field
    variance: Field

    @property
    def depth(self) -> Field:
        """Z = 1/ρ in metres; infinite at ρ = 0, NaN where unknown."""
        with np.errstate(divide="ignore"):
            return np.where(self.value > 0, 1 / self.value, np.where(np.isnan(self.value), np.nan, np.inf)).astype(
                np.float32
            )

    @property
    def depth_std(self) -> Field:
        """σ_Z = √P/ρ² in metres."""
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.asarray(np.sqrt(self.variance) / (self.value * self.value), np.float32)

    @classmethod
    def unknown(cls, shape: tuple[int, int]) -> "InverseDepth":
        """Nothing known anywhere."""
        void = np.full(shape, np.nan, np.float32)
        return cls(void, void.copy())


def predict_inverse_depth(state: InverseDepth, moved: Projection, drift: float) -> InverseDepth:
    """ρ' = ρ/(a + bρ), P' = P a²/(a + bρ)⁴ + r: (2.21), (2.23), (2.24) in inverse depth.

    a + bρ is the scale of the projection and a = scale − bρ; the derivative of ρ' by ρ is a/(a + bρ)².
    drift is the standard deviation that the motion's uncertainty adds, as a part of ρ'.
    """
    scale = moved.scale
    moved_value = state.value / scale
    derivative = (scale - moved.shift_z * state.value) / (scale * scale)
    variance = state.variance * derivative * derivative + np.float32(drift**2) * moved_value * moved_value
    return InverseDepth(moved_value, variance)


def fuse(predicted: InverseDepth, measured: InverseDepth, sure: NDArray[np.bool_], gate: float = 3.0) -> InverseDepth:
    """Combine prediction and measurement: 1/P⁺ = 1/P⁻ + 1/R, ρ⁺ = P⁺ (ρ⁻/P⁻ + ρ_m/R), (2.26)–(2.28).

    Where only one is known it is taken. Where they differ by more than `gate` standard deviations they
    are two surfaces and are not averaged: a measurement confirmed both ways (`sure`) replaces the
    prediction, any other gives way to it.
    """
    has_prediction = np.isfinite(predicted.value)
    has_measurement = np.isfinite(measured.value)
    both = has_prediction & has_measurement
    gap = np.where(both, measured.value - predicted.value, np.float32(0))
    combined = predicted.variance + measured.variance
    with np.errstate(invalid="ignore", divide="ignore"):
        gain = np.where(both, predicted.variance / combined, np.where(has_measurement, np.float32(1), np.float32(0)))
        conflict = both & (gap * gap > np.float32(gate**2) * combined)
    gain = np.where(conflict, sure.astype(np.float32), gain)
    start = np.where(has_prediction, predicted.value, measured.value)
    value = start + gain * gap
    variance = np.where(has_prediction, predicted.variance, measured.variance)
    variance = np.where(both & ~conflict, (1 - gain) * variance, variance)
    variance = np.where(conflict & sure, measured.variance, variance)
    return InverseDepth(value.astype(np.float32), variance.astype(np.float32))
