"""Inverse depths of walls that were rendered ray by ray, from a camera that drives, turns and stands."""

from math import isfinite, nan, radians

import numpy as np
import pytest

from perception.camera.intrinsics import Intrinsics
from perception.flow.errors import ImageError, MotionError, SettingError
from perception.flow.geometry import STILL, CameraMotion
from perception.flow.lateral import LateralFlow, LateralSettings
from tools.flow.drive import CAMERA, LEFT, RIGHT, Drive, outcome
from tools.flow.textures import sense
from tools.flow.walls import Pose, Wall, bare, render, stripes, waves


@pytest.mark.parametrize("mounting", [LEFT, RIGHT])
@pytest.mark.parametrize("distance", [0.3, 0.7, 2.0])
@pytest.mark.parametrize("turn", [0.0, radians(7)])
def test_the_inverse_depth_is_right_on_straight_slanted_and_turning_ways(mounting, distance, turn):
    drives = [
        Drive(mounting, distance, slant=slant, turn=turn, seed=seed)
        for seed, slant in enumerate((0.0, 0.5, -0.7))
    ]
    got = outcome(drives, 15)
    assert len(got.part) == got.images
    # About 6 px of parallax to .01 px; the first measurements have less.
    assert abs(np.median(got.part)) < 0.002
    assert 1.4826 * np.median(np.abs(got.part)) < 0.004
    # 42 errors: a binomial's deviation is 7 and 3 %. Frames share one past frame, so it is twice that.
    assert np.mean(np.abs(got.strength) < 1) > 0.42
    assert np.mean(np.abs(got.strength) < 1.96) > 0.8


def test_faint_walls_are_measured_with_a_greater_deviation():
    got = outcome([Drive(contrast=0.1, seed=seed) for seed in range(4)], 20)
    assert len(got.part) == got.images
    # A tenth of .1 px of 6 px; a fifth of the contrast has five times the deviation.
    assert 1.4826 * np.median(np.abs(got.part)) < 0.012
    assert np.mean(np.abs(got.strength) < 1.96) > 0.85


def test_the_past_frame_is_chosen_for_a_parallax_of_about_6_px_whatever_the_speed():
    for speed in (0.04, 0.08, 0.3):
        shifts = [abs(found.flow_px) for found, _ in Drive(speed=speed, distance=0.7).run(30)][15:]
        step = 192 * speed / 12.5 / 0.7
        # To half a step; .3 m/s moves the wall by 6.6 px from one frame to the next.
        assert shifts == pytest.approx([6.0] * len(shifts), abs=max(0.55 * step, 0.7))


def test_a_drifting_odometry_scale_is_passed_on_as_it_is():
    """Three per cent too long a way make the wall three per cent too far: the flow itself knows no metres."""
    got = outcome([Drive(scale=1.03)], 20)
    assert np.median(got.part) == pytest.approx(1 / 1.03 - 1, abs=0.002)


def test_the_odometry_s_deviation_is_part_of_the_stated_one():
    exact, loose = (list(Drive(deviations=(d, 0.0, 0.0)).run(12))[-1][0].deviation for d in (0.0, 2e-4))
    found = list(Drive().run(12))[-1][0]
    steps = round((found.stamp - found.past_stamp) * 12.5)
    expected = found.inverse_depth * 2e-4 * steps**0.5 / found.motion.right_m
    assert loose == pytest.approx((exact**2 + expected**2) ** 0.5, rel=1e-3)


def test_the_first_image_has_nothing_to_be_compared_with():
    found, _ = next(Drive().run(1))
    assert not found.texture
    assert found.motion is None
    numbers = (found.past_stamp, found.flow_px, found.deviation_px, found.inverse_depth, found.deviation)
    assert all(np.isnan(n) for n in numbers)


def test_a_bare_wall_is_no_wall_at_infinity_but_unknown():
    for found, _ in Drive(levels=bare).run(25):
        assert not found.texture
        assert not found.ambiguous
        assert np.isnan(found.flow_px)
        assert np.isnan(found.inverse_depth)


def test_at_rest_the_last_way_still_measures_and_then_no_distance_is_claimed():
    flow = LateralFlow(CAMERA, settings=LateralSettings(oldest_s=1.0))
    wall, random = Wall(0, 0.805, 0, waves(3, 0.5, 0.01)), np.random.default_rng(0)
    seen, before = [], None
    for k in range(40):
        pose = Pose(-0.323 + 0.0064 * min(k, 10), 0, 0)
        motion = STILL if before is None else LEFT.motion(*before.moved_to(pose))
        seen.append(flow.step(sense(render(wall, CAMERA, LEFT, pose)[0], random), 0.08 * k, motion))
        before = pose
    at_rest = seen[12:18]
    assert [m.inverse_depth for m in at_rest] == pytest.approx([1 / 0.7] * 6, rel=0.01)
    for found in seen[26:]:
        assert np.isnan(found.inverse_depth)
        # The image stands still, which is a measurement: .005 px of deviation.
        assert np.isnan(found.flow_px) or abs(found.flow_px) < 0.03


def test_a_wall_that_ends_is_lost_and_a_nearer_one_is_found_within_a_second():
    """A door: bare for 20 frames; then a box at less than half the distance."""
    far, near = waves(1, 0.5, 0.01), waves(2, 0.5, 0.005)
    flow, random = LateralFlow(CAMERA), np.random.default_rng(0)
    found, before = [], None
    for k in range(60):
        pose = Pose(-0.323 + 0.0064 * k, 0, 0)
        motion = STILL if before is None else LEFT.motion(*before.moved_to(pose))
        depth, levels = (0.7, far) if k < 20 else (0.7, bare) if k < 40 else (0.3, near)
        light, _ = render(Wall(0, 0.105 + depth, 0, levels), CAMERA, LEFT, pose)
        found.append(flow.step(sense(light, random), 0.08 * k, motion))
        before = pose
    assert found[19].inverse_depth == pytest.approx(1 / 0.7, rel=0.01)
    assert not any(isfinite(m.inverse_depth) for m in found[20:40])
    assert not found[39].texture
    # The first frame of the box is compared with bare ones.
    assert found[42].inverse_depth == pytest.approx(1 / 0.3, rel=0.02)
    assert found[59].inverse_depth == pytest.approx(1 / 0.3, rel=0.01)


@pytest.mark.parametrize("period", [0.016, 0.02, 0.0226, 0.03, 0.05, 0.08])
@pytest.mark.parametrize("distance", [0.5, 1.1])
def test_stripes_are_measured_or_unknown_but_never_a_period_off(period, distance):
    for seed, (slant, rate) in enumerate(((0.0, 12.5), (0.3, 25.0), (-0.5, 12.5))):
        nearest = LateralSettings(nearest_m=0.15 if seed else 0.3)
        drive = Drive(LEFT, distance, slant, stripes(period, 0.5), rate=rate, seed=seed, settings=nearest)
        for found, truth in drive.run(16):
            # A period off is at least .2 of the parallax of 16 px that is the most.
            assert np.isnan(found.inverse_depth) or abs(found.inverse_depth / truth - 1) < 0.1
            assert (
                isfinite(found.inverse_depth) or found.ambiguous or not found.texture or found.motion is None
            )


def test_two_centimetre_stripes_near_the_wanted_shift_are_resolved_by_other_frames():
    """5.5 px a period and a shift of 6 px: one past frame alone sees a shift of .5 px as well."""
    drive = Drive(levels=stripes(0.02, 0.5), settings=LateralSettings(nearest_m=0.3))
    found = [(m.inverse_depth, truth) for m, truth in drive.run(25)][5:]
    assert [value for value, _ in found] == pytest.approx([truth for _, truth in found], rel=0.01)


def test_flicker_of_30_per_cent_and_vignetting_do_not_move_the_wall():
    row, column = np.mgrid[0:40, 0:160]
    shade = 1 - 0.4 * ((column + 20) ** 2 + (row + 60) ** 2) / (2 * 128**2)
    for light in (lambda k: 0.7 if k % 2 else 1.0, lambda k: shade):
        got = outcome([Drive(light=light, seed=seed) for seed in range(2)], 20)
        assert len(got.part) == got.images
        assert abs(np.median(got.part)) < 0.003
        # The first way is a third of the one aimed at, and seven tenths of the light are left.
        assert np.abs(got.part).max() < 0.03


def test_a_camera_that_goes_dark_sees_nothing():
    seen = [found for found, _ in Drive(light=lambda k: 1.0 if k < 10 else 0.0).run(20)]
    assert isfinite(seen[9].inverse_depth)
    assert not any(isfinite(m.inverse_depth) or m.texture for m in seen[10:])


def test_images_and_motions_that_cannot_be_are_refused_in_one_line():
    flow, image = LateralFlow(CAMERA), np.full((40, 160), 100, np.uint8)
    flow.step(image, 1.0, STILL)
    for bad, stamp, motion, error, words in (
        (image[:, :100], 2.0, STILL, ImageError, "100×40 pixels: the intrinsics are of 160×40"),
        (image.astype(np.float64), 2.0, STILL, ImageError, "image of float64"),
        (np.dstack([image] * 3), 2.0, STILL, ImageError, "shape"),
        (image, 1.0, STILL, ImageError, "stamped 1.0 s: it must be later than the last one, 1.0 s"),
        (image, nan, STILL, ImageError, "stamped nan"),
        (image, 2.0, CameraMotion(nan, 0.0, 0.0), MotionError, "not finite"),
    ):
        with pytest.raises(error, match=words) as caught:
            flow.step(bad, stamp, motion)
        assert "\n" not in str(caught.value)
    assert not flow.step(image, 2.0, STILL).texture


def test_a_lens_that_bends_is_refused():
    bent = Intrinsics(160, 40, 192.0, 192.0, 79.5, 19.5, (-0.2, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(SettingError, match="straightened"):
        LateralFlow(bent)


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"shift_px": 0.5}, "shift_px is 0.5: it must be 1 to 10"),
        ({"nearest_m": 0.0}, "nearest_m is 0.0"),
        ({"frames": 1}, "frames is 1"),
        ({"oldest_s": 0.0}, "oldest_s is 0.0"),
    ],
)
def test_settings_outside_their_range_are_refused(settings, words):
    with pytest.raises(SettingError, match=words):
        LateralSettings(**settings)


def test_two_runs_give_the_same_numbers():
    assert [m for m, _ in Drive(turn=0.1).run(8)][1:] == [m for m, _ in Drive(turn=0.1).run(8)][1:]
