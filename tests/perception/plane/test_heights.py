"""Heights over a floor: on rendered floors with boxes of known height, and on images that are known exactly."""

from functools import cache

import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.plane.departure import measure_departure
from perception.plane.direct import estimate_plane_motion
from perception.plane.floor import FloorSight, FloorWatch
from perception.plane.heights import HeightMap, measure_heights
from perception.plane.metric_plane import plane_homography
from perception.plane.obstacles import LIMIT, find_obstacles
from perception.plane.parallax import Parallax
from perception.plane.template import Template
from perception.plane.window import Window
from tools.plane.floor_scores import watched
from tools.plane.floors import CAMERA, FloorCase, FloorPair, drive, floor_plane
from tools.plane.images import read_grey

TEXTURE = "noise 61 25"


@cache
def pair(height: float, step_m: float, seed: int, pitch_deg: float = 65.0) -> FloorPair:
    return drive(FloorCase(TEXTURE, height, step_m, pitch_deg, seed))


def heights_of(floor: FloorPair) -> HeightMap:
    template = Template(floor.first, watched())
    seen = estimate_plane_motion(template, floor.second, floor.floor.homography(CAMERA, floor.motion))
    assert seen is not None
    parallax = Parallax.of(watched(), CAMERA, floor.motion, floor.floor.q)
    return measure_heights(template, floor.second, seen, parallax)


def test_an_empty_floor_has_scores_of_unit_deviation_and_no_obstacle() -> None:
    maps = [heights_of(pair(0.0, 0.05, seed)) for seed in (1, 2)]
    for side in range(3):
        scores = np.concatenate([found.score[side].ravel() for found in maps])
        # The bound of the issue.
        assert 0.8 < np.nanstd(scores) < 1.2
    assert all(find_obstacles(found) == [] for found in maps)


# 25 mm at half a metre, one of a box that moves the image by 2.5 px, and one that moves it by 7 px.
@pytest.mark.parametrize(("height", "step_m"), [(0.05, 0.02), (0.02, 0.05), (0.2, 0.1)])
def test_a_box_is_found_where_it_stands_and_as_high_as_it_is(height: float, step_m: float) -> None:
    floor = pair(height, step_m, 11)
    obstacles = find_obstacles(heights_of(floor))
    assert obstacles
    found = obstacles[0]
    x, y = (round(place) for place in found.place_px)
    assert floor.obstacle[y, x]
    assert not found.hole
    assert found.score > LIMIT
    # A cell that reaches over the box's edge sees floor, too, and odometry is wrong by 1 %.
    assert found.height == pytest.approx(height, rel=0.2)


def test_a_hole_is_a_negative_height() -> None:
    # Driving backward over the same images turns the parallax about: what stood up lies below.
    floor = pair(0.05, 0.02, 11)
    template = Template(floor.first, watched())
    seen = estimate_plane_motion(template, floor.second, floor.floor.homography(CAMERA, floor.motion))
    assert seen is not None
    backward = Motion(floor.motion.rotation, -floor.motion.translation)
    parallax = Parallax.of(watched(), CAMERA, backward, floor.floor.q)
    obstacles = find_obstacles(measure_heights(template, floor.second, seen, parallax))
    assert obstacles
    assert obstacles[0].hole
    assert obstacles[0].height == pytest.approx(-0.05, rel=0.25)


def test_parallax_is_the_derivative_of_where_parallel_planes_are_seen() -> None:
    motion = Motion(np.eye(3), np.array([0.01, -0.04, -0.03]))
    q = floor_plane(65.0).q
    window = watched()
    parallax = Parallax.of(window, CAMERA, motion, q)
    h = plane_homography(CAMERA, motion, q)
    x, y = window.pixels()
    step = 1e-5
    # Back in the first image: where the floor shows what stands k = step higher at x.
    shift = np.linalg.solve(h, parallax.at(step, h))
    moved = np.stack((x, y, np.ones_like(x)), axis=-1) @ shift.T
    moved = moved[..., :2] / moved[..., 2:]
    assert (moved[..., 0] - x) / step == pytest.approx(parallax.across, abs=1e-3)
    assert (moved[..., 1] - y) / step == pytest.approx(parallax.down, abs=1e-3)


def test_a_camera_at_rest_knows_no_heights() -> None:
    floor = pair(0.05, 0.02, 11)
    template = Template(floor.first, watched())
    seen = estimate_plane_motion(template, floor.first, np.eye(3))
    assert seen is not None
    parallax = Parallax.of(watched(), CAMERA, Motion.identity(), floor.floor.q)
    found = measure_heights(template, floor.first, seen, parallax)
    assert np.isnan(found.height).all()
    assert find_obstacles(found) == []


def watch(floor: FloorPair) -> tuple[FloorWatch, FloorSight]:
    watching = FloorWatch(CAMERA, floor.floor)
    assert watching.step(floor.first, Motion.identity()) is None
    sight = watching.step(floor.second, floor.motion)
    assert sight is not None
    return watching, sight


def test_the_watch_says_where_an_obstacle_is() -> None:
    floor = pair(0.2, 0.1, 11)
    watching, sight = watch(floor)
    assert sight.believed
    # f sin²δ T/H = 26.3 px for a small step.
    assert sight.flow_px == pytest.approx(26.3, rel=0.1)
    found = sight.obstacles[0]
    place = sight.place_of(found, CAMERA)
    # Its top is h above the floor, H − h below the camera, whatever is in the first image.
    assert pytest.approx(place @ floor_plane(65.0).normal, rel=0.05) == 0.5 * (1 - 0.2)
    # The floor has moved by more than 10 px: the newest image is the key frame now, and at rest against itself.
    still = watching.step(floor.second, Motion.identity())
    assert still is not None
    assert still.flow_px == pytest.approx(0.0, abs=1e-9)
    assert still.obstacles == []


def test_the_key_frame_stays_until_the_floor_has_moved_enough() -> None:
    floor = pair(0.0, 0.02, 2)
    watching, sight = watch(floor)
    assert sight.flow_px < 10
    back = Motion(floor.motion.rotation, floor.motion.translation).inverse()
    returned = watching.step(floor.first, back)
    assert returned is not None
    # Back at the key frame: the two motions have cancelled.
    assert returned.flow_px == pytest.approx(0.0, abs=1e-6)
    assert returned.motion.distance == pytest.approx(0.0, abs=1e-9)


def test_a_floor_that_is_not_seen_is_not_believed_to_be_empty() -> None:
    floor = pair(0.0, 0.02, 2)
    watching = FloorWatch(CAMERA, floor.floor)
    dark = np.full_like(floor.first, 3)
    watching.step(dark, Motion.identity())
    sight = watching.step(dark, floor.motion)
    assert sight is not None
    assert not sight.believed
    assert sight.heights is None
    assert sight.obstacles == []


@pytest.mark.skipif(
    read_grey("visp_cube_plane/image.0020.png") is None, reason="../shared/data/visp_cube_plane is not there"
)
@pytest.mark.parametrize(("start", "middle"), [(20, (212, 116)), (64, (172, 132))])
def test_a_real_cube_is_the_largest_region_that_departs_from_the_poster(
    start: int, middle: tuple[int, int]
) -> None:
    first, second = (read_grey(f"visp_cube_plane/image.{k:04d}.png") for k in (start, start + 4))
    assert first is not None
    assert second is not None
    template = Template(first, Window.central(first.shape, first.shape[1] - 16, first.shape[0] - 16))
    seen = estimate_plane_motion(template, second, tolerance_px=0.1)
    assert seen is not None
    largest, following, *_ = measure_departure(template, second, seen).regions(0.35)
    # Seen by eye: the cube's middle in that frame.
    assert largest.middle_px == pytest.approx(middle, abs=15)
    assert largest.cells > 2 * following.cells
