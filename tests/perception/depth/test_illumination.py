"""Changing light on a rendered scene: what each equalisation takes and what it does not."""

from dataclasses import replace

import numpy as np
import pytest

from perception.depth.settings import DEFAULT, PRESETS, DepthSettings
from tools.depth.light import LIGHTS
from tools.depth.peers import bad_percent
from tools.depth.scenes import Sequence, table_top
from tools.depth.score import run_sequence


@pytest.fixture(scope="module")
def table() -> Sequence:
    return table_top(frames=4, size=(160, 120))


def bad_2(sequence: Sequence, light: str, settings: DepthSettings) -> float:
    """Per cent of the pixels whose disparity over the way so far errs by more than 2 px."""
    change = LIGHTS[light]
    lit = replace(sequence, images=[change(image, k) for k, image in enumerate(sequence.images)])
    found = run_sequence(lit, settings)[-1]
    worth = sequence.camera.fx * sum(motion.distance for motion in sequence.motions)
    scale = np.float32(worth)
    return bad_percent(found.state.value * scale, (sequence.truth[-1] * scale).astype(np.float32), 2.0)


@pytest.mark.parametrize("light", [name for name in LIGHTS if name != "none"])
def test_default_loses_at_most_two_points_to_the_light(table: Sequence, light: str) -> None:
    # the criterion 4
    assert bad_2(table, light, DEFAULT) <= bad_2(table, "none", DEFAULT) + 2.0


def test_default_in_steady_light_is_right(table: Sequence) -> None:
    # a tenth of the pixels are within a window of an edge between surfaces
    assert bad_2(table, "none", DEFAULT) < 10


def thesis(name: str) -> DepthSettings:
    return replace(PRESETS[name], start_depth=1.6)


def test_without_equalisation_the_thesis_fails_in_flicker(table: Sequence) -> None:
    # figure 2.10: grey levels that differ by 30 % match nowhere
    steady, flickering = (
        bad_2(table, light, thesis("thesis-unequalised")) for light in ("none", "flicker ±30 %")
    )
    assert flickering > steady + 20


def test_ratio_of_means_takes_the_flicker(table: Sequence) -> None:
    steady, flickering = (bad_2(table, light, thesis("thesis")) for light in ("none", "flicker ±30 %"))
    assert flickering < steady + 5


def test_ratio_of_means_does_not_take_an_offset(table: Sequence) -> None:
    steady, offset = (bad_2(table, light, thesis("thesis")) for light in ("none", "gain .6 + 20"))
    assert offset > steady + 2
