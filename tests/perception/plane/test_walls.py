"""A real texture on a wall that a camera nears: the criteria, on a few pairs; `tools/reproduce plane` has them all."""

import numpy as np
import pytest

from perception.plane.direct import estimate_plane_motion
from perception.plane.metric_plane import measure_plane
from perception.plane.template import Template
from tools.plane.images import read_grey
from tools.plane.wall_scores import BEFORE, GRAF, judge, window
from tools.plane.walls import CAMERA, LIGHTS, approach_wall, heading_of, pitched_at_wall

pytestmark = pytest.mark.skipif(read_grey(GRAF) is None, reason="../shared/data/planar_graf is not there")
SEEDS = (9000, 9001, 9002)


# The medians that the issue needs; of forty pairs they are half of that and less.
@pytest.mark.parametrize(("steps", "needed_percent"), [(100, 0.8), (25, 0.2), (5, 0.3)])
def test_time_to_contact(steps: int, needed_percent: float) -> None:
    errors = []
    for seed in SEEDS:
        pair = approach_wall(GRAF, seed, steps, 20.0)
        first, second = pair.exposed(seed)
        errors.append(100 * judge(estimate_plane_motion(Template(first, window()), second), pair).error)
    assert np.median(np.abs(errors)) < needed_percent


def test_heading_of_a_wall_seen_by_a_camera_pitched_down() -> None:
    errors = []
    for seed in SEEDS:
        pair = pitched_at_wall(GRAF, seed, 25, 20.0)
        first, second = pair.exposed(seed)
        seen = estimate_plane_motion(Template(first, window()), second)
        assert seen is not None
        plane = measure_plane(seen, CAMERA, pair.motion)
        assert plane is not None
        errors.append(heading_of(plane.normal) - 20.0)
    assert np.median(np.abs(errors)) < 0.25


def test_something_before_a_third_of_the_window_is_not_believed_and_yet_left_out() -> None:
    for seed in SEEDS:
        pair = approach_wall(GRAF, seed, 25, 0.0, 0.35, BEFORE)
        first, second = pair.exposed(seed)
        found = judge(estimate_plane_motion(Template(first, window()), second), pair)
        assert not found.believed
        assert abs(found.error) < 0.01


@pytest.mark.parametrize(
    ("case", "limit_percent"), [("gain .8", 0.3), ("ramp of 40 %", 0.3), ("contrast .1", 2.0)]
)
def test_other_light(case: str, limit_percent: float) -> None:
    errors = []
    for seed in SEEDS:
        pair = approach_wall(GRAF, seed, 25, 0.0)
        first, second = pair.exposed(seed, change=LIGHTS[case])
        found = judge(estimate_plane_motion(Template(first, window()), second), pair)
        assert found.believed
        errors.append(100 * found.error)
    assert np.median(np.abs(errors)) < limit_percent
