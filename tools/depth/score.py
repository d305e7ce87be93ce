"""Sequences through the estimator, and how far the map is from the truth."""

from collections.abc import Sequence as Series
from dataclasses import asdict, dataclass
from itertools import pairwise
from statistics import mean

import numpy as np
from numpy.typing import NDArray

from perception.depth import DepthFromMotion, DepthMap, DepthSettings
from tools.depth.peers import bad_percent
from tools.depth.real_images import Image, Views
from tools.depth.scenes import Sequence

Mask = NDArray[np.bool_]


@dataclass(frozen=True)
class Score:
    """Errors of one map over the pixels (of `where`) that have a truth."""

    median_error: float
    """|ρ − ρ_true|/ρ_true, the same as |Z − Z_true|/Z."""
    mean_error: float
    stated: float
    """Median of the stated deviation as a part of the truth."""
    cover_68: float
    """Per cent of the errors within one and within 1.96 stated deviations."""
    cover_95: float
    density: float
    """Per cent of the pixels that have a depth."""
    confirmed: float

    def to_json(self) -> dict[str, float]:
        """Rounded for the eye."""
        return {name: round(value, 5) for name, value in asdict(self).items()}


def score_map(found: DepthMap, truth: NDArray[np.floating], where: Mask | None = None) -> Score:
    """Compare a map with the true inverse depth (1/m, NaN unknown)."""
    value, variance = found.state.value, found.state.variance
    with np.errstate(invalid="ignore", divide="ignore"):
        error = np.abs(value - truth)
        part, strength = error / truth, error / np.sqrt(variance)
        stated = np.sqrt(variance) / truth
    there = np.isfinite(truth) if where is None else np.isfinite(truth) & where
    known = there & np.isfinite(part) & np.isfinite(strength)
    return Score(
        float(np.median(part[known])),
        float(np.mean(part[known])),
        float(np.median(stated[known])),
        float(100 * np.mean(strength[known] <= 1)),
        float(100 * np.mean(strength[known] <= 1.96)),
        float(100 * np.mean(np.isfinite(value))),
        100 * found.confirmed,
    )


def score_frames(sequence: Sequence, maps: list[DepthMap], where: list[Mask] | None = None) -> list[Score]:
    """The score of each map."""
    masks = where or [np.isfinite(truth) for truth in sequence.truth]
    return [
        score_map(found, truth, mask)
        for found, truth, mask in zip(maps, sequence.truth[1:], masks[1:], strict=True)
    ]


def run_sequence(sequence: Sequence, settings: DepthSettings) -> list[DepthMap]:
    """The maps after the second, third, … image, each in the view of its image."""
    estimator = DepthFromMotion(sequence.camera, settings)
    estimator.start(sequence.images[0])
    pairs = zip(sequence.images[1:], sequence.motions, strict=True)
    return [estimator.step(image, motion) for image, motion in pairs]


def cover_sequence(sequence: Sequence, settings: DepthSettings) -> tuple[float, float]:
    """Per cent of the errors of all maps within 1 and 1.96 stated deviations."""
    scores = score_frames(sequence, run_sequence(sequence, settings))
    # maps of one size: the mean of their coverages is that of all their errors
    return mean(score.cover_68 for score in scores), mean(score.cover_95 for score in scores)


def run_views(
    views: Views,
    order: Series[int],
    settings: DepthSettings,
    anchored: bool = False,
    images: list[Image] | None = None,
) -> list[DepthMap]:
    """The maps of lateral views taken in `order`; when anchored, all are in the view of the first."""
    images = views.images if images is None else images
    estimator = DepthFromMotion(views.camera, settings, anchored)
    estimator.start(images[order[0]])
    maps = []
    for before, now in pairwise(order):
        maps.append(estimator.step(images[now], views.motion(order[0] if anchored else before, now)))
    return maps


def score_views(found: DepthMap, views: Views) -> dict[str, float]:
    """Bad pixels in per cent, density and coverage in the view that has the truth."""
    score = score_map(found, views.truth)
    disparity = found.state.value
    return {
        "bad_0.5": round(bad_percent(disparity, views.truth, 0.5), 2),
        "bad_1": round(bad_percent(disparity, views.truth, 1.0), 2),
        "bad_2": round(bad_percent(disparity, views.truth, 2.0), 2),
        "density": round(score.density, 2),
        "mean_error_px": round(float(np.nanmean(np.abs(disparity - views.truth))), 4),
        "stated_px": round(float(np.nanmean(np.sqrt(found.state.variance))), 4),
        "cover_68": round(score.cover_68, 1),
        "cover_95": round(score.cover_95, 1),
    }
