"""Other ways to the motion of a plane: a dense or sparse flow and a homography of eight parameters fitted to it."""

from collections.abc import Callable
from functools import cache
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.plane.plane_motion import PlaneMotion
from perception.plane.window import Window

Image = NDArray[np.uint8]
Matrix = NDArray[np.float64]


def farneback(first: Image, second: Image) -> NDArray[np.float32]:
    """OpenCV's sample parameters: pyramid .5, 3 levels, window 15, 3 iterations, polynomials 5, 1.2."""
    flow = np.zeros((*first.shape, 2), np.float32)
    return np.asarray(cv2.calcOpticalFlowFarneback(first, second, flow, 0.5, 3, 15, 3, 5, 1.2, 0), np.float32)


@cache
def _dis(preset: int, shape: tuple[int, int]) -> cv2.DISOpticalFlow:
    # One object a size: it keeps what it has allocated, and goes wrong when the size changes.
    return cv2.DISOpticalFlow.create(preset)


def dis_fast(first: Image, second: Image) -> NDArray[np.float32]:
    """DIS, preset fast."""
    dis = _dis(cv2.DISOPTICAL_FLOW_PRESET_FAST, first.shape)
    return np.asarray(dis.calc(first, second, np.zeros((*first.shape, 2), np.float32)), np.float32)


def dis_medium(first: Image, second: Image) -> NDArray[np.float32]:
    """DIS, preset medium."""
    dis = _dis(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM, first.shape)
    return np.asarray(dis.calc(first, second, np.zeros((*first.shape, 2), np.float32)), np.float32)


def fit_flow(flow: NDArray[np.float32], window: Window) -> PlaneMotion | None:
    """A homography by least squares to the flow of a window."""
    x, y = window.pixels()
    here = np.stack((x, y), axis=-1).reshape(-1, 2)
    there = here + flow[window.part].reshape(-1, 2)
    homography, _ = cv2.findHomography(here, there, 0)
    return _as_motion(homography, window)


def match_orb(first: Image, second: Image, window: Window) -> PlaneMotion | None:
    """ORB features matched crosswise, a homography by MAGSAC at 1 px."""
    orb = cv2.ORB.create(1000, 1.2, 8, 15, 0, 2, cv2.ORB_HARRIS_SCORE, 15, 5)
    mask = np.zeros(first.shape, np.uint8)
    mask[window.part] = 255
    here, words = orb.detectAndCompute(first, mask)
    there, other = orb.detectAndCompute(second, np.full(first.shape, 255, np.uint8))
    if words is None or other is None:
        return None
    matches = cv2.BFMatcher(cv2.NORM_HAMMING, True).match(words, other)
    if len(matches) < 8:
        return None
    places = [np.array([keys[index].pt for index in indices]) for keys, indices in (
        (here, [match.queryIdx for match in matches]),
        (there, [match.trainIdx for match in matches]),
    )]  # fmt: skip
    homography, _ = cv2.findHomography(places[0], places[1], cv2.USAC_MAGSAC, 1.0)
    return _as_motion(homography, window)


def _as_motion(homography: Any, window: Window) -> PlaneMotion | None:
    if homography is None or not np.isfinite(homography).all():
        return None
    information = window.flow_products().sum(axis=0).reshape(8, 8)
    every = np.ones((window.rows, window.columns))
    covariance = np.asarray(np.linalg.inv(information))
    return PlaneMotion(homography, window, covariance, information, np.zeros(4), 1.0, 1.0, 1.0, every)


PEERS: dict[str, Callable[[Image, Image, Window], PlaneMotion | None]] = {
    "Farnebäck + 8 parameters": lambda a, b, window: fit_flow(farneback(a, b), window),
    "DIS medium + 8 parameters": lambda a, b, window: fit_flow(dis_medium(a, b), window),
    "DIS fast + 8 parameters": lambda a, b, window: fit_flow(dis_fast(a, b), window),
    "ORB + MAGSAC": match_orb,
}
