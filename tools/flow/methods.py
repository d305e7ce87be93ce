"""The ways to measure a window's flow that are compared: those of perception/flow and OpenCV's."""

from collections.abc import Callable
from dataclasses import dataclass
from math import nan

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.one_pass import OnePassFlow
from perception.flow.pair import estimate_flow
from perception.flow.thesis import ThesisFlow
from perception.flow.window import Window

Image = NDArray[np.uint8]
FRAMES = 5


@dataclass(frozen=True)
class Trial:
    """Five frames of a window that moves by `flow_px` a frame; `predicted_px` is an odometry's guess of it."""

    frames: tuple[Image, ...]
    window: Window
    flow_px: float
    predicted_px: float


Found = tuple[float, float]
"""Flow and its standard deviation, px; NaN where unknown or not stated."""


def warped(trial: Trial) -> Found:
    found = estimate_flow(trial.frames[-1], trial.frames[-2], trial.window, trial.predicted_px)
    return found.flow_px, found.deviation_px


def one_pass(trial: Trial) -> Found:
    flow = OnePassFlow(trial.window)
    found = [flow.step(frame) for frame in trial.frames][-1]
    return (found.flow_px, found.deviation_px) if found else (nan, nan)


def thesis(trial: Trial) -> Found:
    flow = ThesisFlow(trial.window)
    found = [flow.step(frame) for frame in trial.frames][-1]
    return (found.flow_px if found else nan), nan


def farneback_field(past: Image, now: Image) -> NDArray[np.float32]:
    """OpenCV's Farnebäck as its tutorial calls it: 3 levels, windows of 15, 3 iterations, polynomials of 5."""
    flow = cv2.calcOpticalFlowFarneback(past, now, None, 0.5, 3, 15, 3, 5, 1.2, 0)  # type: ignore[call-overload]
    return np.asarray(flow, np.float32)


def dis_field(preset: int, keep: bool = False) -> Callable[[Image, Image], NDArray[np.float32]]:
    """OpenCV's DIS with a preset. A DIS that was used before gives other flows of the same images: without `keep`
    every call has a new one."""
    dis = cv2.DISOpticalFlow.create(preset)

    def flow(past: Image, now: Image) -> NDArray[np.float32]:
        one = dis if keep else cv2.DISOpticalFlow.create(preset)
        # A field of zeros in the place of None would be taken as a first guess.
        return np.asarray(one.calc(past, now, None), np.float32)  # type: ignore[call-overload]

    return flow


def mean_of(
    field: Callable[[Image, Image], NDArray[np.float32]], margin: int = 0
) -> Callable[[Trial], Found]:
    """The mean of a dense flow over the window, which is cut out of both images with `margin` pixels around it."""

    def measure(trial: Trial) -> Found:
        window = trial.window
        left, top = max(window.left - margin, 0), max(window.top - margin, 0)
        right, bottom = window.left + window.width + margin, window.top + window.height + margin
        past, now = (np.ascontiguousarray(f[top:bottom, left:right]) for f in trial.frames[-2:])
        row, column = window.top - top, window.left - left
        flow = field(past, now)[row : row + window.height, column : column + window.width, 0]
        return float(flow.mean()), nan

    return measure


PEER_FIELDS = {
    "DIS ultrafast": dis_field(cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST),
    "DIS fast": dis_field(cv2.DISOPTICAL_FLOW_PRESET_FAST),
    "DIS medium": dis_field(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM),
    "Farnebäck": farneback_field,
}
OURS: dict[str, Callable[[Trial], Found]] = {
    "thesis (3.7)": thesis,
    "one pass": one_pass,
    "warped": warped,
}


def peers(margin: int) -> dict[str, Callable[[Trial], Found]]:
    """The dense flows of OpenCV, given the window and `margin` pixels around it."""
    return {name: mean_of(field, margin) for name, field in PEER_FIELDS.items()}
