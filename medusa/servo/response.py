"""Figures of merit of a step: rise, overshoot, settling, final error."""

from __future__ import annotations

from dataclasses import asdict, dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class StepFigures:
    """Times in s from the step, the rest in the response's unit; NaN where it never got there."""

    rise: float
    """From 10 % to 90 % of the step, interpolated between samples."""
    overshoot: float
    """Greatest way beyond the target, 0 when none."""
    settling: float
    """First sample from which the response stays within the band."""
    final_error: float
    """Target minus the mean of the last tenth."""

    def as_dict(self) -> dict[str, float]:
        """JSON: the figures by name."""
        return asdict(self)


def step_figures(
    time: NDArray[np.float64], response: NDArray[np.float64], step: float, band: float = 0.02
) -> StepFigures:
    """Figures of a response to a step of signed `step` at `time[0]`; `band` is a fraction of the step.

    Shapes (n,) and (n,).
    """
    if step == 0:
        raise ValueError("a step of zero has no figures")
    gone = (np.asarray(response, dtype=np.float64) - response[0]) / step
    tail = gone[-max(1, len(gone) // 10) :]
    last = int(settled_from(np.abs(gone - 1) <= band))
    return StepFigures(
        rise=_crossing(time, gone, 0.9) - _crossing(time, gone, 0.1),
        overshoot=max(0.0, float(gone.max() - 1) * abs(step)),
        settling=float(time[last] - time[0]) if last < len(gone) else float("nan"),
        final_error=float((1 - tail.mean()) * step),
    )


def settled_from(inside: NDArray[np.bool_]) -> NDArray[np.int64]:
    """First sample from which the response stays inside, the number of samples when it ends outside.

    Shape (samples, …batch) to (…batch).
    """
    backwards = ~inside[::-1]
    never_out = ~backwards.any(axis=0)
    return np.asarray(np.where(never_out, 0, len(inside) - np.argmax(backwards, axis=0)), dtype=np.int64)


def _crossing(time: NDArray[np.float64], gone: NDArray[np.float64], level: float) -> float:
    above = np.flatnonzero(gone >= level)
    if above.size == 0:
        return float("nan")
    i = int(above[0])
    if i == 0:
        return float(time[0])
    fraction = (level - gone[i - 1]) / (gone[i] - gone[i - 1])
    return float(time[i - 1] + fraction * (time[i] - time[i - 1]))
