"""Walls without texture, under lights that may pass for one."""

from collections.abc import Callable
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from perception.flow.one_pass import OnePassFlow
from perception.flow.pair import estimate_flow
from perception.flow.window import Window
from tools.flow.textures import sense

Levels = NDArray[np.float64]
ROWS, COLUMNS = 48, 160
WINDOW = Window(48, 8)
_rows, _columns = np.mgrid[0:ROWS, 0:COLUMNS].astype(float)


def _vignetting(left: float, top: float) -> Levels:
    """40 % at the corner of a 256×256 image whose middle is at that pixel of the strip."""
    return np.asarray(150 * (1 - 0.4 * ((_columns - left) ** 2 + (_rows - top) ** 2) / (2 * 128**2)))


BARE: dict[str, tuple[Callable[[], Levels], float]] = {
    "grey, noise 2": (lambda: np.full((ROWS, COLUMNS), 128.0), 2.0),
    "grey, noise .5": (lambda: np.full((ROWS, COLUMNS), 128.0), 0.5),
    "grey, noise 6": (lambda: np.full((ROWS, COLUMNS), 128.0), 6.0),
    "dark, noise 2": (lambda: np.full((ROWS, COLUMNS), 1.0), 2.0),
    "lit from the side, noise 2": (lambda: 80 + 80 * _columns / COLUMNS, 2.0),
    "vignetting in the middle, noise 2": (lambda: _vignetting(80, 24), 2.0),
    "vignetting aside, noise 2": (lambda: _vignetting(20, -30), 2.0),
    "vignetting in the middle, noise .5": (lambda: _vignetting(80, 24), 0.5),
    "vignetting in the middle, no noise": (lambda: _vignetting(80, 24), 0.0),
    "lamp beside, noise 1": (lambda: 200 / (1 + ((_columns - 150) ** 2 + _rows**2) / 120**2), 1.0),
}
"""Light on the wall (grey levels) and the pixels' noise."""


def false_flows(name: str, windows: int) -> tuple[int, int]:
    """In how many windows the warped and the one-pass flow see a flow, of which there is none."""
    make, noise = BARE[name]
    light, random = make(), np.random.default_rng(crc32(name.encode()))
    warped = one_pass = 0
    flow = OnePassFlow(WINDOW)
    frames = [sense(light, random, noise) for _ in range(4)]
    for frame in frames:
        flow.step(frame)
    for _ in range(windows):
        frames = [*frames[1:], sense(light, random, noise)]
        # A prediction opens a range of 17 shifts, and as nothing is found there, all 47 are tried.
        found = estimate_flow(frames[-1], frames[-2], WINDOW, float(random.uniform(-10, 10)))
        warped += not np.isnan(found.flow_px)
        fast = flow.step(frames[-1])
        one_pass += fast is not None and not np.isnan(fast.flow_px)
    return warped, one_pass
