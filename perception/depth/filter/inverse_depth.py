"""The recursive filter: inverse depth and its variance, pixel by pixel, thesis (2.23)–(2.28).

In Z the observation d = C/Z + D must be linearised, and from a distant start the filter of the thesis
leaves for negative depths. In ρ = 1/Z the observation is linear, so the gain needs no linearisation.
"""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.depth.geometry.epipolar import Projection
from perception.image.bands import Band, join_bands
from perception.image.select import select

Field = NDArray[np.float32]
Mask = NDArray[np.bool_]
VAGUE_RATIO = 10.0
"""A measurement with so many times the prediction's deviation shows no other surface within its own uncertainty."""


@dataclass(frozen=True)
class InverseDepth:
    """ρ in 1/m and its variance P in 1/m², NaN where nothing is known; height × width.

    `cost` is the matching cost, 0 to 1, at which the depth was last confirmed; 1 marks a guess, filled in from
    its surroundings.
    """

    value: Field
    variance: Field
    cost: Field

    @property
    def depth(self) -> Field:
        """Z = 1/ρ in metres; infinite at ρ = 0, NaN where unknown."""
        with np.errstate(divide="ignore"):
            return np.where(
                self.value > 0, 1 / self.value, np.where(np.isnan(self.value), np.nan, np.inf)
            ).astype(np.float32)

    @property
    def depth_std(self) -> Field:
        """σ_Z = √P/ρ² in metres."""
        with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
            return np.asarray(np.sqrt(self.variance) / (self.value * self.value), np.float32)

    def rows(self, rows: slice) -> "InverseDepth":
        """Some of the rows."""
        return InverseDepth(self.value[rows], self.variance[rows], self.cost[rows])

    @classmethod
    def unknown(cls, shape: tuple[int, int]) -> "InverseDepth":
        """Nothing known anywhere."""
        unknown = np.full(shape, np.nan, np.float32)
        return cls(unknown, unknown.copy(), np.ones(shape, np.float32))


def predict_inverse_depth(state: InverseDepth, moved: Projection, drift: float) -> InverseDepth:
    """ρ' = ρ/(a + bρ), P' = P a²/(a + bρ)⁴ + r: (2.21), (2.23), (2.24) in inverse depth.

    a + bρ is the scale of the projection and a = scale − bρ; the derivative of ρ' by ρ is a/(a + bρ)².

    Args:
        state: ρ and P, height × width.
        moved: where the pixels go at ρ.
        drift: the standard deviation that the motion's uncertainty adds, √r as a part of ρ'.

    Returns:
        ρ' and P', still at the pixels of `state`.
    """
    scale = moved.scale
    moved_value = state.value / scale
    derivative = (scale - moved.shift_z * state.value) / (scale * scale)
    variance = state.variance * derivative * derivative + np.float32(drift**2) * moved_value * moved_value
    return InverseDepth(moved_value, variance, state.cost)


def fuse(
    predicted: InverseDepth,
    measured: InverseDepth,
    confirmed: Mask,
    gate: float,
    reach: Field,
    repeated: Field | float = 0.0,
    shared: Field | float = 0.0,
) -> InverseDepth:
    """Combine prediction and measurement, (2.26)–(2.28) for errors that have something in common.

    Both err by what every pair repeats, B, and by noise with the variances P = P⁻ − B and Q = R − B and the
    correlation κ, for the two pairs have an image in common. Then ρ⁺ = ρ⁻ + k (ρ_m − ρ⁻) and P⁺ = B + (1 − κ²) P Q/s
    with s = P + Q − 2κ√(P Q) and k = (P − κ√(P Q))/s. B = κ = 0 is the filter of the thesis, 1/P⁺ = 1/P⁻ + 1/R.

    A measurement that was confirmed both ways (`confirmed`) is averaged with the prediction when they agree within
    `gate` standard deviations and within `reach` (1/m). Otherwise they are two surfaces and it replaces it, unless
    they agree by nothing but its own uncertainty (`VAGUE_RATIO`), as on an edge along the motion: then the prediction
    stays. One that was not confirmed only fills what is unknown or a worse guess.

    Args:
        predicted, measured: ρ⁻ and P⁻, ρ_m and R; height × width.
        confirmed: which measurements were confirmed both ways, height × width.
        gate: in standard deviations.
        reach: in 1/m, height × width.
        repeated: B, (1/m)²; 0 by default.
        shared: κ, from −½, the common image between the two others, to ½, both on one side of it.
    """

    whole_repeated, whole_shared = (np.broadcast_to(part, confirmed.shape) for part in (repeated, shared))

    def work(band: Band) -> tuple[Field, ...]:
        rows = band.inner
        common = reach[rows], whole_repeated[rows], whole_shared[rows]
        return _fuse(predicted.rows(rows), measured.rows(rows), confirmed[rows], gate, *common)

    return InverseDepth(*join_bands(confirmed.shape, work))


def _fuse(
    predicted: InverseDepth,
    measured: InverseDepth,
    confirmed: Mask,
    gate: float,
    reach: Field,
    repeated: Field,
    shared: Field,
) -> tuple[Field, ...]:
    known = np.isfinite(predicted.value)
    guess = known & (predicted.cost >= 1)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        gap = measured.value - predicted.value
        repeats = np.minimum(np.minimum(predicted.variance, measured.variance), repeated)
        before, now = predicted.variance - repeats, measured.variance - repeats
        common = shared * np.sqrt(before * now)
        combined = np.maximum(before + now - 2 * common, np.float32(1e-12))
        possible = known & ~guess & (gap * gap <= np.float32(gate**2) * combined)
        holds = (np.abs(gap) <= reach) | (measured.variance > np.float32(VAGUE_RATIO**2) * predicted.variance)
        gain = (before - common) / combined
        left = repeats + (1 - np.square(shared)) * before * now / combined
        better = ~known | (guess & (measured.variance < predicted.variance))
    average = confirmed & possible & (np.abs(gap) <= reach)
    replace = np.isfinite(measured.value) & ((confirmed & ~(possible & holds)) | (~confirmed & better))
    return tuple(
        select(average, mean, select(replace, new, old))
        for mean, new, old in (
            (predicted.value + gain * gap, measured.value, predicted.value),
            (left, measured.variance, predicted.variance),
            (np.minimum(predicted.cost, measured.cost), measured.cost, predicted.cost),
        )
    )
