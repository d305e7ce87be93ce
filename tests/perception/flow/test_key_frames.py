"""Which past frames are kept, and which are compared with."""

from math import pi

import numpy as np
import pytest

from perception.flow.geometry import CameraMotion, Mounting, Ray
from perception.flow.key_frames import KeyFrames, nearest_to
from perception.flow.strip import Strip
from perception.flow.window import Window

RAY = Ray(0.0, 192.0)
STRIP = Strip(np.full((32, 64), 100, np.uint8), Window(0, 0), 0)
FORWARD = Mounting(0.0, 0.0, pi / 2).motion(0.01, 0.0, 0.0)
WALL = 2.0
"""1/Z of a wall half a metre away: 1 cm moves it by 3.84 px."""


def drive(frames, steps, motion=FORWARD, first=0, least_px=1.0):
    for k in range(first, first + steps):
        if k:
            frames.move(motion, 0.1 * k)
        frames.keep(STRIP, 0.1 * k, RAY, WALL, least_px)
    frames.move(motion, 0.1 * (first + steps))


def test_the_candidates_are_a_step_apart_and_end_with_the_first_that_is_enough():
    frames = KeyFrames(10, 9.0)
    drive(frames, 8)
    found = frames.candidates(RAY, WALL, 6.0, 20.0)
    assert [c.parallax_px for c in found] == pytest.approx([-3.84, -7.68])
    assert nearest_to(found, 6.0) is found[1]
    assert frames.motion_since(found[1].frame).right_m == pytest.approx(0.02)


def test_shifts_that_cannot_be_searched_are_left_out():
    frames = KeyFrames(10, 9.0)
    drive(frames, 8)
    assert [c.flow_px for c in frames.candidates(RAY, WALL, 50.0, 20.0)] == pytest.approx(
        [-3.84, -7.68, -11.52, -15.36, -19.2]
    )


def test_a_body_at_rest_keeps_its_past():
    frames = KeyFrames(3, 9.0)
    drive(frames, 3)
    still = CameraMotion(0.0, 0.0, 0.0)
    drive(frames, 20, still, first=4)
    found = frames.candidates(RAY, WALL, 50.0, 50.0)
    # The three frames of the drive were joined by one, at rest: the oldest of them made room for it.
    assert [c.parallax_px for c in found] == pytest.approx([0.0, -3.84, -7.68])


def test_old_frames_are_forgotten():
    frames = KeyFrames(10, 0.35)
    drive(frames, 8)
    assert len(frames.candidates(RAY, WALL, 50.0, 50.0)) == 3


def test_no_frame_is_nearest_to_nothing():
    assert KeyFrames(5, 1.0).candidates(RAY, WALL, 6.0, 20.0) == []
    assert nearest_to([], 6.0) is None
