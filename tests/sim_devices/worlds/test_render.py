"""Rendered pictures: against closed forms, against an estimator of motion, and window against whole."""

from math import pi, radians

import cv2
import numpy as np
import pytest

from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement, constant, facing, on_bearing, rotation_about, sine, still
from sim_devices.worlds.render import render
from sim_devices.worlds.surface import Rectangle, Sphere, box, hidden_between, play
from sim_devices.worlds.texture import Texture, checker, noise, plain
from sim_devices.worlds.truth import depth_map, flow_map, meet, pixel_of
from sim_devices.worlds.world import World

OPTICS = Optics.centred_deg(128, 128, 50.0)
AHEAD = facing((0.0, 0.0, 0.0))


def wall(distance: float, **kwargs: object) -> Rectangle:
    return Rectangle(8.0, 8.0, noise(512, 1), still(facing((distance, 0.0, 0.0), **kwargs)))  # type: ignore[arg-type]


def test_a_plain_wall_has_its_grey_level_everywhere() -> None:
    world = World([Rectangle(8.0, 8.0, plain(77.0), still(facing((2.0, 0.0, 0.0))))])
    assert np.all(render(world, OPTICS, AHEAD, 0.0) == 77.0)


def test_a_picture_is_seen_upright_and_not_mirrored() -> None:
    picture = np.zeros((64, 64), np.uint8)
    picture[:32, :32] = 200  # upper left
    world = World([Rectangle(4.0, 4.0, Texture(picture), still(facing((2.0, 0.0, 0.0))))])
    image = render(world, OPTICS, AHEAD, 0.0)
    assert image[20, 20] == pytest.approx(200.0)
    assert image[20, 107] == image[107, 20] == image[107, 107] == 0.0


def test_a_head_that_turns_left_sees_the_target_go_right() -> None:
    target = Rectangle(0.1, 0.1, plain(255.0), still(facing((1.0, 0.0, 0.0))))
    pixel = pixel_of(World([target]), target, OPTICS, facing((0.0, 0.0, 0.0), radians(5.0)), 0.0)
    assert pixel[0] - OPTICS.cx == pytest.approx(OPTICS.fx * np.tan(radians(5.0)))
    assert pixel[1] == pytest.approx(OPTICS.cy)


def test_depth_of_a_slanted_wall_is_exact() -> None:
    # Plane through (2, 0, 0) with normal n: the ray r meets it at Z = (p.n)/(r.n); bound from issue 11: 1 um.
    turn = radians(25.0)
    depth = depth_map(World([wall(2.0, heading=turn)]), OPTICS, AHEAD, 0.0)
    columns, rows = OPTICS.rays(OPTICS.whole)
    expected = 2.0 * np.cos(turn) / (np.cos(turn) - np.sin(turn) * columns[None, :] + 0.0 * rows[:, None])
    assert np.max(np.abs(depth - expected)) < 1e-6


def test_depth_of_a_sphere_is_exact() -> None:
    world = World([Sphere(0.3, plain(99.0), still(Placement(position=np.array([1.5, 0.2, -0.1]))))])
    depth = depth_map(world, OPTICS, AHEAD, 0.0)
    columns, rows = OPTICS.rays(OPTICS.whole)
    x, y = np.meshgrid(columns, rows)
    points = np.stack([x * depth, y * depth, depth], axis=-1)[~np.isnan(depth)]
    # Optical axes: x right = -y of the world, y down = -z. All hits lie on the sphere, and on its near side.
    distance = np.linalg.norm(points - np.array([-0.2, 0.1, 1.5]), axis=1)
    assert len(points) > 500
    assert np.max(np.abs(distance - 0.3)) < 1e-6
    assert np.max(depth[~np.isnan(depth)]) < np.hypot(1.5, 0.3)


def test_the_nearest_surface_wins_whatever_the_order() -> None:
    near = Rectangle(0.4, 0.4, plain(200.0), still(facing((1.0, 0.0, 0.0))))
    far = Rectangle(9.0, 9.0, plain(50.0), still(facing((2.0, 0.0, 0.0), radians(40.0))))
    one = render(World([near, far]), OPTICS, AHEAD, 0.0)
    other = render(World([far, near]), OPTICS, AHEAD, 0.0)
    assert np.array_equal(one, other)
    assert one[64, 64] == 200.0
    assert one[5, 64] == 50.0


def test_walls_that_pass_through_each_other_hide_each_other_exactly() -> None:
    left = Rectangle(20.0, 20.0, plain(50.0), still(facing((2.0, 0.0, 0.0), radians(30.0))))
    right = Rectangle(20.0, 20.0, plain(150.0), still(facing((2.0, 0.0, 0.0), radians(-30.0))))
    image = render(World([left, right]), OPTICS, AHEAD, 0.0)
    # They cross in the plane of the optical axis; each is the nearer one on its own side.
    assert np.all(image[:, :64] == image[0, 0])
    assert np.all(image[:, 64:] == image[0, 127])
    assert {float(image[0, 0]), float(image[0, 127])} == {50.0, 150.0}


def test_any_window_is_the_same_part_of_the_whole() -> None:
    world = World(
        [wall(2.0, heading=0.4), *box((0.3, 0.3, 0.3), noise(64, 5), still(facing((1.2, 0.1, 0.0))))]
    )
    world.add(Sphere(0.2, noise(128, 6), still(Placement(position=np.array([1.0, -0.3, 0.1])))))
    whole = render(world, OPTICS, AHEAD, 0.0)
    part = render(world, OPTICS, AHEAD, 0.0, Window(30, 40, 60, 50))
    # The mip level is interpolated from a coarse grid over the part; a grey level is well below any noise.
    assert np.max(np.abs(part - whole[40:90, 30:90])) < 1.0
    depth = depth_map(world, OPTICS, AHEAD, 0.0)
    assert np.array_equal(depth_map(world, OPTICS, AHEAD, 0.0, Window(30, 40, 60, 50)), depth[40:90, 30:90])


def test_a_window_outside_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match="128 x 128"):
        render(World(), OPTICS, AHEAD, 0.0, Window(100, 0, 60, 50))


@pytest.mark.parametrize("shift_px", [(0.36, 0.0), (0.0, 0.36)])
def test_measured_flow_agrees_with_the_exact_flow(shift_px: tuple[float, float]) -> None:
    world = World([Rectangle(8.0, 8.0, noise(1024, 1), still(facing((2.0, 0.0, 0.0), 0.2, 0.1)))])
    moved = facing((0.0, -2.0 * shift_px[0] / OPTICS.fx, -2.0 * shift_px[1] / OPTICS.fy))
    images = [
        np.clip(render(world, OPTICS, camera, 0.0) + 0.5, 0, 255).astype(np.uint8)
        for camera in (AHEAD, moved)
    ]
    exact = flow_map(world, OPTICS, (AHEAD, 0.0), (moved, 0.0))
    rows, columns = (axis.ravel() for axis in np.mgrid[12:116:4, 12:116:4])
    points = np.stack([columns, rows], axis=-1).astype(np.float32)[:, None]
    found, _, _ = cv2.calcOpticalFlowPyrLK(
        images[0], images[1], points, np.empty(0, np.float32),
        winSize=(15, 15), maxLevel=1, criteria=(3, 30, 1e-3),
    )  # fmt: skip
    error = (found - points)[:, 0] - exact[rows, columns]
    # Issue 11: within .025 px at .36 px; most of it is Lucas and Kanade's own bilinear bias.
    assert np.mean(np.hypot(error[:, 0], error[:, 1])) < 0.025


def test_exact_flow_of_a_turning_camera_is_independent_of_depth() -> None:
    turned = facing((0.0, 0.0, 0.0), radians(2.0))
    near = flow_map(World([wall(1.0)]), OPTICS, (AHEAD, 0.0), (turned, 0.0))
    far = flow_map(World([wall(3.0)]), OPTICS, (AHEAD, 0.0), (turned, 0.0))
    assert np.max(np.abs(near - far)) < 1e-9
    columns, _ = OPTICS.rays(OPTICS.whole)
    expected = OPTICS.fx * (np.tan(np.arctan(columns) + radians(2.0)) - columns)
    assert np.max(np.abs(near[64, :, 0] - expected)) < 0.05  # row 64 lies half a pixel under the axis


def test_exact_flow_follows_a_moving_surface() -> None:
    target = Rectangle(0.5, 0.5, plain(9.0), on_bearing(sine(0.3, 0.5), constant(0.0), constant(2.0)))
    world = World([target], epoch=1.0)
    flow = flow_map(world, OPTICS, (AHEAD, 1.0), (AHEAD, 1.1))
    before, after = (pixel_of(world, target, OPTICS, AHEAD, t) for t in (1.0, 1.1))
    hits = meet(world, OPTICS, AHEAD, 1.0)
    middle = np.nanargmin(np.sum(hits.body**2, axis=-1))
    assert np.abs(flow.reshape(-1, 2)[middle] - (after - before)).max() < 0.05


def test_a_far_texture_fades_to_its_mean_instead_of_aliasing() -> None:
    world = World([Rectangle(60.0, 60.0, checker((1024, 1024), cell=1), still(facing((20.0, 0.0, 0.0))))])
    image = render(world, Optics.centred_deg(64, 64, 60.0), AHEAD, 0.0)
    assert np.abs(image - 125.0).max() < 2.0  # (30 + 220)/2, three squares to a sample


def test_a_box_shows_its_three_near_faces_and_its_size() -> None:
    size = (0.2, 0.4, 0.6)
    world = World(box(size, plain(100.0), still(Placement(position=np.array([2.0, 0.0, 0.0])))))
    depth = depth_map(world, OPTICS, AHEAD, 0.0)
    assert depth[64, 64] == pytest.approx(1.9, abs=1e-9)
    seen = ~np.isnan(depth)
    # Widths from the front face at 1.9 m: 0.4 m across, 0.6 m high; whole pixels, one at each edge.
    assert seen[64].sum() == pytest.approx(OPTICS.fx * 0.4 / 1.9, abs=2.0)
    assert seen[:, 64].sum() == pytest.approx(OPTICS.fy * 0.6 / 1.9, abs=2.0)
    turned = World(
        box(size, plain(100.0), still(Placement(rotation_about(2, 0.5), np.array([2.0, 0.0, 0.0]))))
    )
    assert len(np.unique(meet(turned, OPTICS, AHEAD, 0.0).surface)) == 3  # two faces and nothing


def test_a_screen_plays_its_pictures_forth_and_back() -> None:
    show = play([plain(float(v)) for v in (10, 20, 30)], rate=6.0)
    shown = [show(k / 6.0) for k in range(6)]
    assert [t.picture[0, 0] for t in shown if t is not None] == [10, 20, 30, 20, 10, 20]


def test_a_hidden_target_vanishes_and_comes_back() -> None:
    world = World(
        [Rectangle(4.0, 4.0, hidden_between(plain(200.0), 1.0, 2.0), still(facing((2.0, 0.0, 0.0))))]
    )
    levels = [float(render(world, OPTICS, AHEAD, t)[64, 64]) for t in (0.5, 1.0, 1.9, 2.0)]
    assert levels == [200.0, 40.0, 40.0, 200.0]


def test_lights_out_leaves_only_what_glows() -> None:
    lamp = Rectangle(0.2, 0.2, plain(255.0), still(facing((1.0, 0.0, 0.0))), elliptic=True, glows=True)
    image = render(World([wall(2.0), lamp], light=0.0), OPTICS, AHEAD, 0.0)
    assert image[64, 64] == 255.0
    assert image[5, 5] == 0.0
    # An ellipse covers pi/4 of its square.
    covered = image.sum() / 255.0 / (OPTICS.fx * 0.2) ** 2
    assert covered == pytest.approx(pi / 4.0, rel=0.02)


def test_a_surface_that_reaches_behind_the_camera_is_cut_at_the_lens() -> None:
    floor = Rectangle(
        40.0, 40.0, noise(256, 2, repeat=(10.0, 10.0)), still(facing((0.0, 0.0, -1.0), 0.0, pi / 2))
    )
    depth = depth_map(World([floor]), OPTICS, AHEAD, 0.0)
    _, rows = OPTICS.rays(OPTICS.whole)
    below = rows > 1.0 / 20.0  # the floor ends 20 m ahead
    assert np.max(np.abs(depth[below, 64] - 1.0 / rows[below])) < 1e-6
    assert np.isnan(depth[:64]).all()
    image = render(World([floor]), OPTICS, AHEAD, 0.0)
    assert np.isfinite(image).all()
    assert image[100:].std() > 5.0
