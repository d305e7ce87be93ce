"""Normal flow against the ground truth of Middlebury: error of the component along the gradient, and coverage."""

from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.normal import NormalFlow, estimate_normal_flow, estimate_warped_normal_flow
from tools.plane.images import DATA, Image, read_grey
from tools.plane.peers import dis_fast

Field = NDArray[np.float64]
STRONGEST = 0.3
"""Part of the pixels, those of the strongest gradients, that is scored."""


@dataclass(frozen=True, eq=False)
class FlowPair:
    """Two frames, the true flow of the first (NaN unknown), and the frames around them if there are any."""

    name: str
    frames: tuple[Image, Image]
    u: Field
    v: Field
    burst: list[Image]
    """Five frames with the first in the middle; empty when there are none."""


def read_pair(name: str) -> FlowPair | None:
    """RubberWhale or Venus, None where it is absent."""
    folder = f"flow_middlebury/{name}"
    first, second = (read_grey(f"{folder}/frame{k}.png") for k in (10, 11))
    if first is None or second is None:
        return None
    coded = np.asarray(cv2.imread(str(DATA / folder / "flow10_kitti16.png"), cv2.IMREAD_UNCHANGED))
    valid = coded[..., 0] > 0
    v, u = (np.where(valid, (coded[..., k].astype(float) - 32768) / 64, np.nan) for k in (1, 2))
    burst = [read_grey(f"flow_middlebury/{name}_8frames/frame{k:02d}.png") for k in range(8, 13)]
    return FlowPair(name, (first, second), u, v, [frame for frame in burst if frame is not None])


def score(found: NormalFlow, pair: FlowPair) -> dict[str, float]:
    """Median and mean error in px over the strongest gradients, per cent within 1 and 1.96 deviations."""
    there, known = _strongest(found, pair), np.isfinite(found.flow)
    with np.errstate(invalid="ignore", divide="ignore"):
        true = (found.slope_x * pair.u + found.slope_y * pair.v) / found.strength
    error = np.abs(found.flow - true)[there & known]
    off = error / found.std[there & known]
    return {
        "median_px": round(float(np.median(error)), 4),
        "mean_px": round(float(error.mean()), 3),
        "cover_68": round(100 * float(np.mean(off < 1)), 1),
        "cover_95": round(100 * float(np.mean(off < 1.96)), 1),
    }


def score_dis(pair: FlowPair) -> dict[str, float]:
    """The same component of the flow of DIS."""
    flow = dis_fast(*pair.frames)
    gradient = estimate_normal_flow(pair.frames)
    there = _strongest(gradient, pair)
    with np.errstate(invalid="ignore", divide="ignore"):
        error = gradient.slope_x * (flow[..., 0] - pair.u) + gradient.slope_y * (flow[..., 1] - pair.v)
        error = np.abs(error / gradient.strength)[there]
    return {"median_px": round(float(np.median(error)), 4), "mean_px": round(float(error.mean()), 3)}


def score_pair(pair: FlowPair) -> dict[str, Any]:
    """One pass, with 3 and 5 frames where there are, warped once, and DIS."""
    table = {
        "one pass, 2 frames": score(estimate_normal_flow(pair.frames), pair),
        "warped once": score(estimate_warped_normal_flow(*pair.frames), pair),
        "DIS fast": score_dis(pair),
    }
    if len(pair.burst) == 5:
        table["one pass, 3 frames"] = score(estimate_normal_flow(pair.burst[1:4]), pair)
        table["one pass, 5 frames"] = score(estimate_normal_flow(pair.burst), pair)
    return table


def _strongest(found: NormalFlow, pair: FlowPair) -> NDArray[np.bool_]:
    known = np.isfinite(pair.u)
    return known & (found.strength >= np.quantile(found.strength[known], 1 - STRONGEST))
