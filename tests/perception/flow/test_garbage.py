"""Images and motions of no world at all: every answer is a number with a deviation, or unknown, and no error."""

import warnings
from math import isfinite

import cv2
import numpy as np
import pytest

from perception.camera.intrinsics import Intrinsics
from perception.flow.geometry import CameraMotion
from perception.flow.lateral import LateralFlow
from perception.flow.one_pass import OnePassFlow
from perception.flow.pair import estimate_flow
from perception.flow.thesis import ThesisFlow
from perception.flow.window import Window


def garbage(random, height, width):
    column, noise = np.arange(width), random.integers(0, 256, (height, width)).astype(np.uint8)
    row = (
        np.full(width, random.integers(256)),
        127 + 127 * np.sin(column * random.uniform(0.1, 3.1)),
        np.linspace(0, 255, width),
        np.where(column < random.integers(width), 0, 255),
    )
    kind = int(random.integers(8))
    if kind < len(row):
        return np.ascontiguousarray(np.broadcast_to(row[kind].astype(np.uint8), (height, width)))
    if kind == 4:
        return (random.random((height, width)) < 0.02).astype(np.uint8) * 255
    if kind == 5:
        return np.clip(128 + random.normal(0, random.uniform(0, 30), (height, width)), 0, 255).astype(
            np.uint8
        )
    return noise if kind == 6 else cv2.GaussianBlur(noise, (0, 0), random.uniform(0.5, 8))


def consistent(flow, deviation):
    assert isfinite(flow) == isfinite(deviation)
    assert not np.isinf(flow)
    assert not deviation <= 0


@pytest.mark.parametrize("seed", range(24))
def test_garbage_is_answered_or_unknown(seed):
    random = np.random.default_rng(seed)
    height, width = int(random.integers(8, 60)), int(random.integers(24, 200))
    across, down = int(random.integers(24, width + 1)), int(random.integers(8, height + 1))
    window = Window(
        int(random.integers(0, width - across + 1)), int(random.integers(0, height - down + 1)), across, down
    )
    camera = Intrinsics(
        width, height, random.uniform(50, 400), 100.0, width * random.uniform(-0.5, 1.5), height / 2
    )
    lateral, one_pass, thesis = LateralFlow(camera, window), OnePassFlow(window), ThesisFlow(window)
    scene, past = garbage(random, height, width + 60), None
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        for k in range(12):
            shift = k * int(random.integers(0, 5))
            image = np.ascontiguousarray(scene[:, shift : shift + width])
            if random.random() < 0.4:
                image = garbage(random, height, width)
            size = (1.0, 1.0, 3.0) if random.random() < 0.1 else (0.02, 0.02, 0.1)
            motion = CameraMotion(*random.normal(0, size)) if random.random() < 0.8 else CameraMotion(0, 0, 0)
            seen = lateral.step(image, float(k), motion)
            consistent(seen.flow_px, seen.deviation_px)
            consistent(seen.inverse_depth, seen.deviation)
            fast = one_pass.step(image)
            if fast:
                consistent(fast.flow_px, fast.deviation_px)
            thesis.step(image)
            if past is not None:
                found = estimate_flow(image, past, window, random.normal(0, 30))
                consistent(found.flow_px, found.deviation_px)
            past = image
