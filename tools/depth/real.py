"""The real part of the experiment, with OpenCV's matchers in the same run."""

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from perception.camera.motion import Motion
from perception.depth import DEFAULT, PRESETS, DepthFromMotion, DepthSettings
from tools.depth.light import LIGHTS, dim
from tools.depth.peers import Field, bad_percent, fill_from_left, match_bm, match_sgbm
from tools.depth.real_images import Image, Views
from tools.depth.scenes import Sequence
from tools.depth.score import run_sequence, run_views, score_frames, score_map, score_views

IN_ORDER = (0, 1, 4, 3, 2)
"""Views 1, 2, 5, 4, 3: the map ends in the one with the truth."""
ANCHORED = (2, 0, 1, 3, 4)
"""View 3 as reference frame, the others in their order."""
PAIR = {"Tsukuba": (2, 3), "Cones": (0, 1)}
PEERS: dict[str, Callable[[Image, Image, int], Field]] = {
    "StereoSGBM 3-way": match_sgbm,
    "StereoBM": match_bm,
}
MIDDLE_PX = {"Tsukuba": 8.0, "Cones": 30.0}


def lateral(preset: str, name: str) -> DepthSettings:
    """A preset for views whose inverse depth is their disparity: 0 to 64 px are searched, in both images alike."""
    settings = replace(PRESETS[preset], near=1 / 64, far=1e4)
    return replace(settings, start_depth=1 / MIDDLE_PX[name]) if settings.literal else settings


def grey(image: Image) -> Image:
    """One channel."""
    return np.asarray(cv2.cvtColor(image, cv2.COLOR_BGR2GRAY))


def score_five_views(views: Views) -> dict[str, Any]:
    """Tsukuba's five views: the map warped to view 3, which has the truth, or anchored in it and scored each time."""
    warped, thesis = (
        run_views(views, IN_ORDER, lateral(preset, views.name))[-1] for preset in ("default", "thesis")
    )
    return {
        "views 1, 2, 5, 4, 3": [score_views(warped, views)],
        "reference frame 3": [
            score_views(found, views)
            for found in run_views(views, ANCHORED, lateral("default", views.name), anchored=True)
        ],
        "thesis, views 1, 2, 5, 4, 3": [score_views(thesis, views)],
    }


def score_pair(views: Views, left: Image, right: Image, presets: tuple[str, ...]) -> dict[str, Any]:
    """One pair of images: ours and OpenCV's."""
    first, second = PAIR[views.name]
    images = list(views.images)
    images[first], images[second] = left, right
    result: dict[str, Any] = {}
    for preset in presets:
        maps = run_views(views, (first, second), lateral(preset, views.name), True, images)
        result[preset] = score_views(maps[-1], views)
    for name, match in PEERS.items():
        disparity = match(left, right, views.most)
        filled = fill_from_left(disparity)
        result[name] = {
            "bad_0.5": round(bad_percent(filled, views.truth, 0.5), 2),
            "bad_1": round(bad_percent(filled, views.truth, 1.0), 2),
            "bad_2": round(bad_percent(filled, views.truth, 2.0), 2),
            "density": round(float(100 * np.isfinite(disparity).mean()), 2),
        }
    return result


def score_pairs(views: Views) -> dict[str, Any]:
    """The pair as it is and in poor contrast."""
    left, right = (grey(views.images[k]) for k in PAIR[views.name])
    return {
        "as it is": score_pair(views, left, right, ("default", "thesis")),
        "contrast × .15, σ = 2": score_pair(views, dim(left, 0), dim(right, 1), ("default",)),
    }


def score_light_of_pair(views: Views) -> dict[str, dict[str, float]]:
    """Bad-2.0 in four lights by three presets and OpenCV's matchers."""
    first, second = (grey(views.images[k]) for k in PAIR[views.name])
    result: dict[str, dict[str, float]] = {}
    for light, change in LIGHTS.items():
        scores = score_pair(views, change(first, 0), change(second, 1), tuple(PRESETS))
        for name, score in scores.items():
            result.setdefault(name, {})[light] = score["bad_2"]
    return result


def score_hand_held(sequence: Sequence) -> dict[str, Any]:
    """TUM's nine frames: the map warped along, and anchored in the last view with the others against it."""
    settings = replace(DEFAULT, near=0.3, far=10.0)
    warped = [score.to_json() for score in score_frames(sequence, run_sequence(sequence, settings))]
    last = len(sequence.images) - 1
    estimator = DepthFromMotion(sequence.camera, settings, anchored=True)
    estimator.start(sequence.images[last])
    held = []
    for k in range(last):
        found = estimator.step(sequence.images[k], Motion.between(sequence.poses[last], sequence.poses[k]))
        held.append(score_map(found, sequence.truth[last]).to_json())
    return {"carried along": warped, "reference frame 9": held}
