"""The rendered part of the experiment: planes, table-top, sea bed, stripes, and light on a scene of known depth."""

from dataclasses import replace
from typing import Any

import cv2
import numpy as np

from perception.depth import DEFAULT, PRESETS, DepthMap, DepthSettings
from tools.depth.light import LIGHTS
from tools.depth.peers import bad_percent
from tools.depth.scenes import Sequence, sea_bed, slanted_plane, stripes, table_top
from tools.depth.score import Mask, run_sequence, score_frames

SURE_START_M = {"plane": 2.0, "table-top": 1.6, "sea bed": 11.0, "stripes": 1.8}
"""Where the thesis's preset begins; the default needs no start."""


def chosen(preset: str, sequence: Sequence) -> DepthSettings:
    """A preset for a rendered scene."""
    settings = PRESETS[preset]
    return replace(settings, start_depth=SURE_START_M[sequence.name]) if settings.literal else settings


def score_planes() -> dict[str, Any]:
    """Criterion 1: exact planes without and with noise, default and thesis."""
    result: dict[str, Any] = {}
    for noise in (0.0, 2.0):
        sequence = slanted_plane(noise=noise)
        for preset in ("default", "thesis"):
            scores = score_frames(sequence, run_sequence(sequence, chosen(preset, sequence)))
            result[f"noise {noise:g}, {preset}"] = [score.to_json() for score in scores]
    return result


def score_scene(sequence: Sequence) -> tuple[dict[str, Any], dict[str, list[DepthMap]]]:
    """Frame by frame with the three presets; the maps for the figures."""
    maps = {preset: run_sequence(sequence, chosen(preset, sequence)) for preset in PRESETS}
    return {
        preset: [score.to_json() for score in score_frames(sequence, found)] for preset, found in maps.items()
    }, maps


def edge_masks(sequence: Sequence, along_x: bool) -> list[Mask]:
    """Pixels of every image whose surroundings (9×9) change mostly across the other direction."""
    masks = []
    for image in sequence.images:
        grey = image.astype(np.float32)
        power_x, power_y = (
            cv2.blur(np.square(cv2.Sobel(grey, cv2.CV_32F, *order)), (9, 9)) for order in ((1, 0), (0, 1))
        )
        strong = power_x + power_y > 0.5 * float(np.median(power_x + power_y))
        masks.append(np.asarray(strong & (power_y > 6 * power_x if along_x else power_x > 6 * power_y)))
    return masks


def score_turn(frames: int = 8, turn: int = 4) -> dict[str, Any]:
    """Horizontal edges before and after the motion turns vertical, beside a motion that never turns."""
    result: dict[str, Any] = {"turns_after": turn}
    for name, at in (("right then up", turn), ("right only", frames)):
        sequence = stripes(frames, at)
        maps = run_sequence(sequence, DEFAULT)
        for kind, along_x in (("horizontal edges", True), ("vertical edges", False)):
            scores = score_frames(sequence, maps, edge_masks(sequence, along_x))
            result[f"{name}, {kind}"] = [score.to_json() for score in scores]
    return result


def score_edges_of_table(sequence: Sequence, maps: list[DepthMap]) -> dict[str, Any]:
    """The same of the table-top, whose texture has edges of all directions."""
    return {
        kind: [score.to_json() for score in score_frames(sequence, maps, edge_masks(sequence, along_x))]
        for kind, along_x in (("horizontal edges", True), ("vertical edges", False))
    }


def score_light(frames: int = 5) -> dict[str, dict[str, float]]:
    """Bad-2.0 (px over the whole way) of a table-top in four lights by three presets."""
    table = table_top(frames=frames)
    scale = np.float32(table.camera.fx * sum(motion.distance for motion in table.motions))
    result: dict[str, dict[str, float]] = {}
    for preset in PRESETS:
        result[preset] = {}
        for light, change in LIGHTS.items():
            lit = replace(table, images=[change(image, k) for k, image in enumerate(table.images)])
            found = run_sequence(lit, chosen(preset, table))[-1]
            truth = (table.truth[-1] * scale).astype(np.float32)
            result[preset][light] = round(bad_percent(found.state.value * scale, truth, 2.0), 2)
    return result


def scenes() -> tuple[Sequence, Sequence]:
    """The table-top of figure 2.12 and the sea bed of figure 2.10."""
    return table_top(), sea_bed()
