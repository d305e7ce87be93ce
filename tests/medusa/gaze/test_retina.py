"""From pictures to tangents: both eyes, one eye, and a camera that sits turned on its joint."""

import numpy as np
import pytest

from medusa.calibration.head_geometry import turn_matrix
from medusa.gaze.retina import Retina
from medusa.kinematics import Joints
from perception.camera.frame import Frame
from perception.camera.intrinsics import Intrinsics
from perception.camera.pairing import FramePair
from perception.target import detect_bright_target

LENS = Intrinsics(64, 64, 88.0, 88.0, 31.5, 31.5)
REST = Joints(0.0, 0.0, 0.0, 0.0)


def detect(image):
    return detect_bright_target(image, 100)


def picture(column, row, size=64):
    image = np.zeros((size, size), np.uint8)
    image[row - 1 : row + 2, column - 1 : column + 2] = 250
    return image


def frame(image):
    return Frame(image, 1.0, "eye", 0)


def test_a_spot_right_of_and_under_the_axis_has_positive_tangents():
    retina = Retina(LENS, LENS, detect, detect)
    seen = retina.look(FramePair(frame(picture(40, 50)), frame(picture(20, 50))), REST)
    assert seen.left == pytest.approx(((40 - 31.5) / 88, (50 - 31.5) / 88))
    assert seen.right == pytest.approx(((20 - 31.5) / 88, (50 - 31.5) / 88))


def test_an_eye_without_a_picture_or_without_the_target_sees_none():
    retina = Retina(LENS, LENS, detect, detect)
    seen = retina.look(FramePair(None, frame(np.zeros((64, 64), np.uint8))), REST)
    assert seen.left is None
    assert seen.right is None
    assert not seen.seen


def test_a_picture_of_twice_the_size_gives_the_same_directions():
    retina = Retina(LENS, LENS, detect, detect)
    small = retina.look(FramePair(frame(picture(40, 30)), None), REST)
    large_image = np.kron(picture(40, 30), np.ones((2, 2), np.uint8))
    large = retina.look(FramePair(frame(large_image), None), REST)
    assert large.left == pytest.approx(small.left, abs=1e-9)


def test_a_camera_turned_on_its_joint_is_turned_back():
    # 2 degrees to the left about the vertical, which is -y of the optical axes: what the camera sees ahead is
    # 2 degrees left of where the joint looks.
    turn = turn_matrix((0.0, -np.radians(2.0), 0.0))
    image = np.zeros((65, 65), np.uint8)
    image[31:34, 31:34] = 250
    lens = Intrinsics(65, 65, 88.0, 88.0, 32.0, 32.0)
    retina = Retina(lens, lens, detect, detect, turns=(turn, np.eye(3)))
    seen = retina.look(FramePair(frame(image), frame(image)), REST)
    assert seen.left == pytest.approx((-np.tan(np.radians(2.0)), 0.0), abs=1e-9)
    assert seen.right == pytest.approx((0.0, 0.0), abs=1e-9)


def test_a_colour_picture_is_looked_at_in_grey():
    retina = Retina(LENS, LENS, detect, detect)
    grey = picture(40, 30)
    seen = retina.look(FramePair(frame(np.dstack([grey] * 3)), None), REST)
    assert seen.left == pytest.approx(((40 - 31.5) / 88, (30 - 31.5) / 88))


def test_by_disparity_the_right_eye_finds_what_the_left_eye_has_around_its_target():
    rng = np.random.default_rng(5)
    left = rng.integers(30, 90, (64, 64)).astype(np.uint8)
    left[28:33, 35:40] = 250
    right = np.roll(left, -6, axis=1)  # nearer things stand further left in the right eye
    never = lambda image: None  # noqa: E731 (the right eye must not need a detector)
    retina = Retina(LENS, LENS, detect, never, by_disparity=True)
    seen = retina.look(FramePair(frame(left), frame(right)), REST)
    assert seen.left == pytest.approx(((37 - 31.5) / 88, (30 - 31.5) / 88), abs=1e-3)
    # A whole shift is found to a twentieth of a pixel.
    assert seen.right == pytest.approx((seen.left[0] - 6 / 88, seen.left[1]), abs=0.05 / 88)


def test_by_disparity_a_target_at_the_rim_is_seen_by_the_left_eye_alone():
    retina = Retina(LENS, LENS, detect, detect, by_disparity=True)
    seen = retina.look(FramePair(frame(picture(2, 30)), frame(picture(2, 30))), REST)
    assert seen.left is not None
    assert seen.right is None
