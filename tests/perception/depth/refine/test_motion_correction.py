"""A motion with errors, corrected by its epipolar residuals."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.estimator import DepthFromMotion
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.match.coarse_match import match_coarsely
from perception.depth.match.search_range import widest_range
from perception.depth.match.view import View
from perception.depth.refine.motion_correction import Correction, correct_motion, motion_jacobian
from perception.depth.settings import DEFAULT
from tools.depth.scenes import Plane, Scene, Sequence, place, render_sequence, slanted_plane, table_top, waves
from tools.depth.score import run_sequence, score_map


@pytest.fixture(scope="module")
def table() -> Sequence:
    return table_top(frames=4, size=(256, 192))


def disturbed(motion: Motion, turn: tuple[float, float, float], shift: tuple[float, float, float]) -> Motion:
    rotation = cv2.Rodrigues(np.array(turn))[0]
    return Motion(rotation @ motion.rotation, motion.translation + np.array(shift))


def correct(table: Sequence, motion: Motion) -> Correction:
    first, second = (View(image.astype(np.float32)) for image in table.images[:2])
    geometry = Epipolar(table.camera, motion, first.shape)
    coarse = match_coarsely(first, second, geometry, widest_range(geometry, DEFAULT), DEFAULT)
    return correct_motion(coarse, DEFAULT)


def test_the_jacobian_is_the_difference_of_two_projections() -> None:
    camera = Pinhole(200.0, 210.0, 79.5, 59.5)
    motion = disturbed(Motion.identity(), (0.02, -0.05, 0.1), (0.1, -0.05, 0.2))
    column, row, inverse_depth = np.array([10.0, 150.0]), np.array([100.0, 20.0]), np.array([0.5, 1.3])
    found = motion_jacobian(Epipolar(camera, motion, (120, 160)), inverse_depth, column, row)
    ray = np.stack([(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones(2)])

    def project(error: np.ndarray) -> np.ndarray:
        q = cv2.Rodrigues(error[:3])[0] @ motion.rotation @ ray
        q += inverse_depth * (motion.translation + error[3:])[:, None]
        return np.stack([camera.fx * q[0] / q[2], camera.fy * q[1] / q[2]], axis=-1)

    for k in range(6):
        step = np.zeros(6)
        step[k] = 1e-5
        # central differences of step h err as h²
        expected = (project(step) - project(-step)) / 2e-5
        np.testing.assert_allclose(found[:, :, k], expected, rtol=1e-6, atol=1e-6)


def test_an_exact_motion_is_left_as_it_is(table: Sequence) -> None:
    motion = table.motions[0]
    found = correct(table, motion)
    assert found.motion is motion
    assert (found.residual_px, found.error_px) == (0.0, 0.0)


# The camera moves right, so that its lines are the rows: pitch and roll leave residuals, yaw looks like depth.
@pytest.mark.parametrize("turn", [(0.01, 0.0, 0.0), (0.0, 0.0, 0.02)], ids=["pitch", "roll"])
def test_a_wrong_rotation_across_the_lines_is_found(
    table: Sequence, turn: tuple[float, float, float]
) -> None:
    found = correct(table, disturbed(table.motions[0], turn, (0.0, 0.0, 0.0)))
    left = Motion(found.motion.rotation @ table.motions[0].rotation.T, np.zeros(3)).angle
    # .01 rad are 2.8 px at the focal length of 282 px; a third may be left to the translation that looks alike
    assert left < np.linalg.norm(turn) / 3
    # the pitch moves all pixels by 2.8 px, the roll by .02 times their column, 1.3 px in the median; the parabola of a
    # coarse error surface takes that for up to twice as much
    assert 0.8 < found.residual_px < 6


def test_the_remaining_error_is_no_smaller_than_what_looks_like_depth(table: Sequence) -> None:
    # pitch and yaw wrong alike: the yaw cannot be seen and stays, .01 rad or 2.8 px
    found = correct(table, disturbed(table.motions[0], (0.01, 0.01, 0.0), (0.0, 0.0, 0.0)))
    assert found.error_px > 1.4


def shaken(table: Sequence, seed: int) -> list[Motion]:
    """Motions from the first image whose pitch and roll err by .4°, as of poses measured one by one."""
    rng = np.random.default_rng(seed)
    exact = [Motion.between(table.poses[0], pose) for pose in table.poses[1:]]
    return [
        disturbed(motion, (rng.normal(0, 0.007), 0.0, rng.normal(0, 0.007)), (0.0, 0.0, 0.0))
        for motion in exact
    ]


def held(table: Sequence, motions: list[Motion]) -> float:
    estimator = DepthFromMotion(table.camera, DEFAULT, anchored=True)
    estimator.start(table.images[0])
    for image, motion in zip(table.images[1:], motions, strict=True):
        found = estimator.step(image, motion)
    return score_map(found, table.truth[0]).median_error


def test_depth_gains_from_the_correction(table: Sequence, monkeypatch: pytest.MonkeyPatch) -> None:
    motions = [shaken(table, seed) for seed in range(1, 7)]
    corrected = np.mean([held(table, m) for m in motions])
    monkeypatch.setattr("perception.depth.refine.motion_correction.SLACK", np.inf)
    as_given = np.mean([held(table, m) for m in motions])
    # pitch and roll are seen across the lines, but so is what looks like them, a rise or a step forward; a single
    # sequence may lose, and twelve of them have half the error
    assert corrected < 0.7 * as_given


@pytest.mark.parametrize("pitch_px", [-8, 8, 12])
def test_a_motion_that_errs_by_more_than_a_coarse_pixel_is_found(table: Sequence, pitch_px: int) -> None:
    # a coarse pixel is 4 of the finest; beyond about one its error surface has no minimum in reach
    estimator = DepthFromMotion(table.camera, DEFAULT)
    estimator.start(table.images[0])
    turn = (pitch_px / table.camera.fx, 0.0, 0.0)
    found = estimator.step(table.images[1], disturbed(table.motions[0], turn, (0.0, 0.0, 0.0)))
    # steps of 6 px, and what the coarse match finds beside them
    assert 5 < found.residual_px < 20
    # what looks like a pitch, a rise or a roll, is a part of the depth
    assert score_map(found, table.truth[1]).median_error < 0.1
    assert found.confirmed > 0.9


def test_steps_that_err_alike_are_followed_although_their_errors_add_up() -> None:
    # three steps to the right, each pitched by 2 px too much
    table = table_top(frames=8, size=(256, 192))
    estimator = DepthFromMotion(table.camera, DEFAULT)
    estimator.start(table.images[0])
    for image, motion in zip(table.images[1:4], table.motions[:3], strict=True):
        found = estimator.step(image, disturbed(motion, (2 / table.camera.fx, 0.0, 0.0), (0.0, 0.0, 0.0)))
        # alone or added up, and the coarse match takes them for up to twice as much
        assert 1.5 < found.residual_px < 12
    assert score_map(found, table.truth[3]).median_error < 0.03


def test_a_motion_with_residuals_keeps_the_keyframe_until_the_baseline_is_long() -> None:
    # a step of .03 m to the right shifts the median, 2.1 m away, by 4 px: two stay below the limit of 12, four do not
    table = table_top(frames=10, size=(256, 192))
    estimator = DepthFromMotion(table.camera, DEFAULT)
    estimator.start(table.images[0])
    kept = [estimator._keyframe.view]
    for image, motion in zip(table.images[1:5], table.motions[:4], strict=True):
        estimator.step(image, disturbed(motion, (0.004, 0.0, 0.0), (0.0, 0.0, 0.0)))
        kept.append(estimator._keyframe.view)
    assert kept[0] is kept[1] is kept[2]
    assert kept[4] is not kept[0]


def test_standing_still_is_no_second_measurement_of_a_pair_with_residuals(table: Sequence) -> None:
    estimator = DepthFromMotion(table.camera, DEFAULT)
    estimator.start(table.images[0])
    assert estimator.step(
        table.images[1], disturbed(table.motions[0], (0.004, 0.0, 0.0), (0.0, 0.0, 0.0))
    ).measured
    assert not estimator.step(table.images[1], Motion.identity()).measured


def test_a_slow_camera_measures_as_soon_as_its_steps_add_up() -> None:
    # .0004 m a step shift a point at .1 m by .8 px of 200 px focal length: with near = .25 m a third of a pixel
    sequence = slanted_plane(frames=2, size=(96, 72))
    camera, settings = sequence.camera, replace(DEFAULT, near=0.25)
    scene = Scene((Plane((0, 0, 0.4), (1, 0, 0), (0, 1, 0)),), waves(5, 8 * 0.4 / camera.fx, 0.1))
    slow = render_sequence(
        "slow", scene, camera, (96, 72), [place(0.0009 * i, 0, 0) for i in range(9)], samples=1
    )
    maps = run_sequence(slow, settings)
    assert [found.measured for found in maps] == [False, True] * 4
    # .22 px a step at .4 m; a match errs by some hundredths
    assert score_map(maps[-1], slow.truth[-1]).median_error < 0.1
