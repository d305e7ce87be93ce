"""Bias, deviation and coverage of many flows."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass

import numpy as np

from tools.flow.methods import Found


@dataclass(frozen=True)
class Score:
    """Of flows with one truth, or errors over stated deviations of many; per cent.

    found: how many there are. bias: median error, deviation: 1.4826 times the median distance from it, stated: median
    stated deviation, all as parts of the true flow. cover_68, cover_95: within 1 and 1.96 stated deviations.
    """

    found: float
    bias: float
    deviation: float
    stated: float
    cover_68: float
    cover_95: float

    def to_json(self) -> dict[str, float | None]:
        """Rounded for the eye; None where there is nothing."""
        return {k: None if v != v else round(v, 3) for k, v in asdict(self).items()}


def score(found: Iterable[Found], flow_px: float) -> Score:
    """Compare flows and their deviations with the truth."""
    pairs = np.array(list(found), float)
    known = pairs[np.isfinite(pairs[:, 0])]
    if not len(known):
        return Score(0.0, *[float("nan")] * 5)
    error = known[:, 0] - flow_px
    bias = float(np.median(error))
    part = 100 / abs(flow_px)
    strength = np.abs(error) / known[:, 1]
    stated = np.isfinite(strength)
    covers = [
        float(100 * np.mean(strength[stated] <= k)) if stated.any() else float("nan") for k in (1, 1.96)
    ]
    return Score(
        100 * len(known) / len(pairs),
        bias * part * np.sign(flow_px),
        float(1.4826 * np.median(np.abs(error - bias)) * part),
        float(np.median(known[:, 1])) * part,
        covers[0],
        covers[1],
    )
