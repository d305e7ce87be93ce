"""Lateral flow of a 64×32 window beside Farnebäck and DIS on the same window, by turns, on one processor.

Ours get images of 256×256 and cut the window themselves; the peers get it cut out. Issue: warped with a prediction at
most 1.6 Farnebäck (goal .66), one pass at most .5 (goal .3).
"""

import argparse
import json
import os
import sys
import time
from collections.abc import Callable
from statistics import median

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.flow.geometry import CameraMotion
from perception.flow.lateral import LateralFlow
from perception.flow.one_pass import OnePassFlow
from perception.flow.pair import estimate_flow
from perception.flow.thesis import IMAGES, ThesisFlow
from perception.flow.window import Window
from tools.flow.methods import dis_field, farneback_field
from tools.flow.textures import CONTRAST, MEAN, SIDE, Texture, sense

Image = NDArray[np.uint8]
LIMITS = {"LateralFlow.step": (1.6, 0.66), "OnePassFlow.step": (0.5, 0.3)}
FLOW_PX = 1.75
FRAMES = 40
CAMERA = Intrinsics(SIDE, SIDE, 192.0, 192.0, 127.5, 127.5)
MOTION = CameraMotion(-FLOW_PX * 0.7 / CAMERA.fx, 0.0, 0.0)
"""A wall .7 m away that moves by 1.75 px a frame."""


def frames() -> list[Image]:
    texture = Texture(0, rows=SIDE)
    random = np.random.default_rng(0)
    return [sense(MEAN + CONTRAST / 2 * texture.moved(k * FLOW_PX), random) for k in range(FRAMES)]


def ways() -> dict[str, Callable[[int], object]]:
    """What is timed: each takes the number of a call."""
    window, images = Window.centred(SIDE, SIDE), frames()
    rows, columns = (
        slice(window.top, window.top + window.height),
        slice(window.left, window.left + window.width),
    )
    cut = [np.ascontiguousarray(image[rows, columns]) for image in images]
    lateral, one_pass, thesis = LateralFlow(CAMERA, window), OnePassFlow(window), ThesisFlow(window)
    stamps = iter(range(10**9))

    def step(k: int) -> object:
        # Backwards after the last frame, and then the wall and the camera move the other way.
        forward = k // FRAMES % 2 == 0
        place = k % FRAMES if forward else FRAMES - 1 - k % FRAMES
        still = k % FRAMES == 0
        motion = CameraMotion(0.0 if still else MOTION.right_m * (1 if forward else -1), 0.0, 0.0)
        return lateral.step(images[place], 0.08 * next(stamps), motion)

    def peer(field: Callable[[Image, Image], object]) -> Callable[[int], object]:
        return lambda k: field(cut[k % (FRAMES - 1)], cut[k % (FRAMES - 1) + 1])

    dis = {
        "DIS ultrafast": cv2.DISOPTICAL_FLOW_PRESET_ULTRAFAST,
        "DIS fast": cv2.DISOPTICAL_FLOW_PRESET_FAST,
        "DIS medium": cv2.DISOPTICAL_FLOW_PRESET_MEDIUM,
    }
    return {
        "Farnebäck": peer(farneback_field),
        **{name: peer(dis_field(preset, keep=True)) for name, preset in dis.items()},
        "LateralFlow.step": step,
        "estimate_flow": lambda k: estimate_flow(
            images[k % (FRAMES - 1) + 1], images[k % (FRAMES - 1)], window, FLOW_PX
        ),
        "OnePassFlow.step": lambda k: one_pass.step(images[k % FRAMES]),
        f"ThesisFlow, {IMAGES} steps": lambda k: [thesis.step(image) for image in images[:IMAGES]],
    }


def time_by_turns(rounds: int, calls: int) -> dict[str, float]:
    """Median microseconds of a call, in rounds of so many calls of each."""
    timed = ways()
    times: dict[str, list[float]] = {name: [] for name in timed}
    for number in range(rounds):
        for name, way in timed.items():
            for k in range(number * calls, (number + 1) * calls):
                start = time.perf_counter()
                way(k)
                times[name].append(time.perf_counter() - start)
    return {name: 1e6 * median(values[calls:]) for name, values in times.items()}


def main(argv: list[str]) -> int:
    """Print a table; the exit code is 1 when a limit is passed."""
    parser = argparse.ArgumentParser(prog="tools/bench flow", description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("--rounds", type=int, default=60)
    parser.add_argument(
        "--calls", type=int, default=20, help="calls of one way in a round; 1: caches are cold"
    )
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    if options.rounds < 2 or options.calls < 1:
        parser.error(f"--rounds is {options.rounds} and --calls {options.calls}, must be at least 2 and 1")
    cv2.setNumThreads(1)
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})
    found = time_by_turns(options.rounds, options.calls)
    whole = found["Farnebäck"]
    if options.json:
        print(
            json.dumps({name: {"us": us, "of_farneback": us / whole} for name, us in found.items()}, indent=2)
        )
    else:
        for name, us in found.items():
            limit = "  needed <= {:g}, goal {:g}".format(*LIMITS[name]) if name in LIMITS else ""
            print(f"{name:<24}{us:>8.0f} µs{us / whole:>8.2f} Farnebäck{limit}")
    return int(any(found[name] > limit * whole for name, (limit, _) in LIMITS.items()))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
