"""Cameras on a base: where they stand, what they see of a wall when it drives, and what is wrong with them."""

from math import cos, pi, radians, sin

import cv2
import numpy as np
import pytest
from numpy.typing import NDArray

from sim_devices.camera import SimulatedCamera
from sim_devices.carried import carried_camera, motion_of, side_eyes
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.worlds.config import CarriedCameraConfig
from sim_devices.worlds.optics import Window
from sim_devices.worlds.placement import Motion, Placement, rotation_about
from sim_devices.worlds.plan import Mount, Plan, TextureConfig, Wall
from sim_devices.worlds.walls import build_world

Array = NDArray[np.float64]
RHO, THETA, F, C = 0.34, radians(72.0), 192.0, 127.5
WINDOW = (96, 112, 64, 32)


def at(x: float, y: float, heading: float) -> Motion:
    return lambda t: Placement(rotation_about(2, heading), np.array([x, y, 0.0]))


def eye(side: float, plan: Plan, carrier: Motion, seed: int = 0, **changes: object) -> SimulatedCamera:
    """The noise-free eye of one side, +1 left."""
    config = side_eyes(**{"noise": 0.0, **changes})[0 if side > 0.0 else 1]
    return carried_camera(config, build_world(plan, seed=seed), {"base": carrier})


def alongside(distance: float, slant: float, side: float) -> Plan:
    """A wall 16 m long beside the origin, turned from the x axis by the slant."""
    way = 8.0 * np.array([cos(slant), sin(slant)])
    ends = [tuple((np.array([0.0, side * distance]) + s * way).tolist()) for s in (-1.0, 1.0)]
    return Plan(wall=[Wall(points=ends)])


Pose = tuple[float, float, float]


def predicted_flow(
    before: Pose, after: Pose, distance: float, slant: float, side: float
) -> tuple[Array, Array]:
    """Where the wall points of the window's pixels go, in the plane of the floor: ray, line, projection."""

    def camera(pose: Pose) -> tuple[Array, Array, Array]:
        x, y, h = pose
        forward, aside = RHO * sin(THETA), side * RHO * cos(THETA)
        centre = np.array([x + forward * cos(h) - aside * sin(h), y + forward * sin(h) + aside * cos(h)])
        axis = side * np.array([-sin(h), cos(h)])
        return centre, axis, np.array([axis[1], -axis[0]])  # the image's right is right of the axis

    columns = np.arange(WINDOW[0], WINDOW[0] + WINDOW[2], dtype=float)
    rows = np.arange(WINDOW[1], WINDOW[1] + WINDOW[3], dtype=float)[:, None]
    centre, axis, right = camera(before)
    normal = np.array([-sin(slant), cos(slant)])
    rays = axis + (columns[:, None] - C) / F * right
    depth = (normal @ np.array([0.0, side * distance]) - normal @ centre) / (rays @ normal)
    points = centre + depth[:, None] * rays
    centre, axis, right = camera(after)
    depth_after = (points - centre) @ axis
    u = F * ((points - centre) @ right) / depth_after + C - columns
    v = (rows - C) * (depth / depth_after - 1.0)
    return np.broadcast_to(u, v.shape), v


def interpolate(image: Array, x: Array, y: Array) -> Array:
    """Lanczos of 8 x 8 pixels, with weights of every fraction: those of cv2.remap are steps of 1/32 pixel."""

    def taps(place: Array) -> tuple[NDArray[np.intp], Array]:
        index = np.floor(place).astype(np.intp)[..., None] + np.arange(-3, 5)
        weights = np.sinc(place[..., None] - index) * np.sinc((place[..., None] - index) / 4.0)
        return index, weights / weights.sum(-1, keepdims=True)

    (i, across), (j, down) = taps(x), taps(y)
    patch = image[j.clip(0, image.shape[0] - 1)[..., :, None], i.clip(0, image.shape[1] - 1)[..., None, :]]
    found: Array = np.einsum("...j,...ji,...i->...", down, patch, across)
    return found


def flow_scale(before: Array, after: Array, u: Array, v: Array) -> float:
    """By how much all of the predicted flow must be multiplied to lay one image on the other."""
    rows, columns = np.mgrid[0 : before.shape[0], 0 : before.shape[1]].astype(float)
    down, across = np.gradient(cv2.GaussianBlur(before, (0, 0), 1.0))
    slope = u * across + v * down
    scale = 1.0
    for _ in range(4):
        x, y = columns + scale * u, rows + scale * v
        inside = (np.minimum(x, columns) > 4) & (np.maximum(x, columns) < before.shape[1] - 5)
        inside &= (np.minimum(y, rows) > 4) & (np.maximum(y, rows) < before.shape[0] - 5)
        rest = (before - interpolate(after, x, y))[inside]
        scale += float(slope[inside] @ rest / (slope[inside] @ slope[inside]))
    return scale


@pytest.mark.parametrize("side", [1.0, -1.0])
@pytest.mark.parametrize(("distance", "shift_px"), [(0.5, 6.0), (0.725, 6.0), (1.3, 6.0), (0.725, 10.0)])
def test_measured_flow_of_a_wall_is_the_predicted_one(side: float, distance: float, shift_px: float) -> None:
    rng = np.random.default_rng(round(1000.0 * distance + shift_px))
    scales = []
    for seed in range(4):
        slant, heading = rng.uniform(-0.35, 0.35), rng.uniform(-0.1, 0.1)
        step = shift_px * (distance - RHO * cos(THETA)) / F
        turn = step * rng.uniform(-0.3, 0.3)
        before, after = (0.0, 0.0, heading), (step * cos(heading), step * sin(heading), heading + turn)
        plan = alongside(distance, slant, side)
        images = [
            eye(side, plan, at(*pose), seed, window=WINDOW).expose([0.0], 0).image.astype(float)
            for pose in (before, after)
        ]
        u, v = predicted_flow(before, after, distance, slant, side)
        assert np.sign(u.mean()) == -side  # driving ahead, the left image goes left
        scales.append(flow_scale(images[0], images[1], u, v))
    # Asked for: 0.3 %. A window of sharp 1/f texture in 8 bits is known to 0.003 px, 0.05 % here.
    assert np.abs(np.array(scales) - 1.0).max() < 0.003


def test_the_eyes_sit_at_their_polar_place_and_look_straight_aside() -> None:
    # The right one at ρ(cos θ, sin θ) with X to the right and Y ahead, as (3.9) and (3.15) need it.
    left, right = side_eyes()
    assert [left.mount.x, left.mount.y] == pytest.approx([0.323, 0.105], abs=5e-4)
    assert [right.mount.x, right.mount.y] == pytest.approx([0.323, -0.105], abs=5e-4)
    for side, config in ((1.0, left), (-1.0, right)):
        frame = eye(side, Plan(), at(1.0, 2.0, pi / 2.0)).pose(0.0)
        # The base looks along y: its left is -x.
        assert frame.rotation[:, 2] == pytest.approx([-side, 0.0, 0.0], abs=1e-12)
        assert frame.rotation[:, 1] == pytest.approx([0.0, 0.0, -1.0], abs=1e-12)
        assert frame.position == pytest.approx([1.0 - side * RHO * cos(THETA), 2.0 + RHO * sin(THETA), 0.35])
        assert config.optics.fx == 192.0


def test_a_mount_yaws_left_pitches_down_and_rolls_to_the_right() -> None:
    def axes(**turn: float) -> Array:
        return Mount(on="base", **turn).placement().rotation

    assert axes(yaw_deg=90.0)[:, 0] == pytest.approx([0.0, 1.0, 0.0])
    assert axes(pitch_deg=90.0)[:, 0] == pytest.approx([0.0, 0.0, -1.0])
    assert axes(roll_deg=90.0)[:, 1] == pytest.approx([0.0, 0.0, 1.0])  # its left side up


def test_a_camera_exposes_where_the_base_is_and_not_where_it_believes_to_be() -> None:
    machine = BaseMachine(BaseConfig(slip_left=0.05, start_y=0.1), 1)
    machine.base.motion.drive(0.2, 0.0, 100.0)
    camera = carried_camera(side_eyes()[0], build_world(Plan()), {"base": motion_of(machine)})
    seen = camera.pose(5.0)
    x, y, heading = machine.pose(5.0)
    believed = machine.base.motion.body.odometry
    assert abs(heading - believed.heading) > 0.1  # 5 % of 1 m on 0.337 m
    aside, forward = RHO * cos(THETA), RHO * sin(THETA)
    assert seen.position[:2] == pytest.approx(
        [x + forward * cos(heading) - aside * sin(heading), y + forward * sin(heading) + aside * cos(heading)]
    )


def test_a_window_is_that_part_of_the_image() -> None:
    plan, part = alongside(0.8, 0.2, 1.0), (100, 60, 64, 32)
    whole = eye(1.0, plan, at(0.0, 0.0, 0.0)).expose([0.0], 0).image
    window = eye(1.0, plan, at(0.0, 0.0, 0.0), window=part).expose([0.0], 0).image
    assert window.shape == (32, 64)
    # The mip level is interpolated over the part: a grey level, as everywhere in the renderer.
    assert np.abs(window.astype(int) - whole[60:92, 100:164]).max() <= 1


def test_a_window_outside_the_image_is_refused() -> None:
    with pytest.raises(ValueError, match=r"Window\(left=200.*256 x 256"):
        side_eyes(window=(200, 0, 64, 32))


def row_of(side: float, **changes: object) -> Array:
    """A dark wall 1 m beside the base with a light one 0.2 m wide in its middle: one row of the image."""
    dark, light = TextureConfig(kind="bare", mean=50.0), TextureConfig(kind="bare", mean=200.0)
    x, y = RHO * sin(THETA), side
    plan = Plan(
        wall=[
            Wall(points=[(x - 8.0, y), (x + 8.0, y)], texture=dark),
            Wall(points=[(x - 0.1, 0.999 * y), (x + 0.1, 0.999 * y)], top=0.35, texture=light),
        ]
    )
    return eye(side, plan, at(0.0, 0.0, 0.0), **changes).expose([0.0], 0).image[130].astype(float)


def edges(row: Array) -> Array:
    """Both places where the row crosses the middle grey, in pixels from the principal point."""
    i = np.flatnonzero((row[:-1] < 125.0) != (row[1:] < 125.0))
    return i + (125.0 - row[i]) / (row[i + 1] - row[i]) - C


def test_a_wrong_focal_length_is_what_the_camera_file_does_not_know() -> None:
    half = 0.1 * F / (0.999 - RHO * cos(THETA))
    # A pixel that an edge crosses has a grey between: linear in the place of the edge, half a sample off.
    assert edges(row_of(1.0)) == pytest.approx([-half, half], abs=0.3)
    assert edges(row_of(1.0, focal_error=0.2)) == pytest.approx([-1.2 * half, 1.2 * half], abs=0.3)


def test_wrong_angles_and_heights_move_the_image() -> None:
    # Yaw positive left moves what is seen to the right: by f tan in the middle.
    assert edges(row_of(-1.0, yaw_error_deg=2.0)).mean() == pytest.approx(F * np.tan(radians(2.0)), abs=0.5)
    config = side_eyes(height_error=0.02, pitch_error_deg=1.0)[0]
    assert config.true_mount.z == pytest.approx(0.37)
    assert config.true_mount.placement().rotation[2, 0] == pytest.approx(-sin(radians(1.0)))
    assert config.mount == side_eyes()[0].mount  # what the file says stays


def test_gain_drifts_with_the_worlds_time_and_a_covered_lens_sees_noise_alone() -> None:
    grey = Plan(wall=alongside(0.8, 0.0, 1.0).wall, texture=TextureConfig(kind="bare", mean=100.0))
    camera = eye(1.0, grey, at(0.0, 0.0, 0.0), gain_drift=0.02, window=WINDOW)
    camera.world.epoch = 3.0
    assert [int(camera.expose([t], 0).image[0, 0]) for t in (3.0, 8.0, 13.0)] == [100, 110, 120]
    camera.dark = True
    assert not camera.expose([3.0], 0).image.any()


def test_a_camera_on_nothing_is_refused() -> None:
    config = CarriedCameraConfig(name="station", mount=Mount(on="wall"))
    with pytest.raises(ValueError, match=r"camera 'station': mount\.on = 'wall'.*there is world"):
        carried_camera(config, build_world(Plan()), {})


def test_a_camera_may_stand_in_the_world() -> None:
    config = CarriedCameraConfig(
        name="station", mount=Mount(on="world", x=2.0, yaw_deg=180.0), window=(0, 0, 9, 7)
    )
    camera = carried_camera(config, build_world(Plan()), {})
    assert camera.pose(9.0).rotation[:, 2] == pytest.approx([-1.0, 0.0, 0.0], abs=1e-12)
    assert camera.window == Window(0, 0, 9, 7)
