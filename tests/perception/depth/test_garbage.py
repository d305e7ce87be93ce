"""Images and motions that belong to nothing: an answer or one of our errors, never a crash or a warning."""

from collections.abc import Callable

import cv2
import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.errors import ImageError
from perception.depth.estimator import DepthFromMotion
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.settings import PRESETS

Random = np.random.Generator
PICTURES: dict[str, Callable[[Random, tuple[int, int]], np.ndarray]] = {
    "dark": lambda rng, shape: np.zeros(shape, np.uint8),
    "white": lambda rng, shape: np.full(shape, 255, np.uint8),
    "noise": lambda rng, shape: rng.integers(0, 256, shape).astype(np.uint8),
    "stripes": lambda rng, shape: np.tile((np.arange(shape[1]) % 7 * 30).astype(np.uint8), (shape[0], 1)),
    "clouds": lambda rng, shape: cv2.GaussianBlur(rng.integers(0, 256, shape).astype(np.uint8), (0, 0), 2),
    "almost even": lambda rng, shape: rng.integers(100, 103, shape).astype(np.uint8),
}


@pytest.mark.filterwarnings("error")
@pytest.mark.parametrize("kind", PICTURES)
@pytest.mark.parametrize(("preset", "cases"), [("default", 12), ("thesis", 4)])
def test_any_images_with_any_motion_give_a_map_with_variances(preset: str, cases: int, kind: str) -> None:
    rng = np.random.default_rng(list(PICTURES).index(kind))
    for case in range(cases):
        height, width = (int(side) for side in rng.integers(16, 120, 2))
        focal = width * rng.uniform(0.3, 3, 2)
        centre = width * rng.uniform(-1, 2) if case % 5 == 0 else width / 2
        camera = Pinhole(float(focal[0]), float(focal[1]), float(centre), height / 2)
        estimator = DepthFromMotion(camera, PRESETS[preset], anchored=case % 3 == 0)
        estimator.start(PICTURES[kind](rng, (height, width)))
        for _ in range(3):
            turn, way = (rng.normal(0, 10 ** rng.uniform(-4, most), 3) for most in (0.5, 2.0))
            motion = Motion(cv2.Rodrigues(turn)[0], way)
            state = estimator.step(PICTURES[kind](rng, (height, width)), motion).state
            known = np.isfinite(state.value)
            assert state.value.shape == (height, width)
            assert (state.variance[known] >= 0).all()


def test_a_image_that_holds_no_window_is_refused() -> None:
    estimator = DepthFromMotion(Pinhole(50, 50, 20, 5))
    with pytest.raises(ImageError, match="an image of 40×10: at least 16×16 are needed"):
        estimator.start(np.zeros((10, 40), np.uint8))
