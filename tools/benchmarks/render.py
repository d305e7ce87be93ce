"""Rendering against one bare cv2.remap of the same size and sampling, run alternately.

64² and 128² of a scene with three surfaces, and the 64 x 32 window of a side eye that passes the funnel's walls
and box: at most 80 times one bare remap; goal 25 times in NumPy.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from statistics import median

import cv2
import numpy as np

from sim_devices.carried import side_eyes
from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement, constant, facing, on_bearing, sine, still
from sim_devices.worlds.plan_files import read_plan
from sim_devices.worlds.render import SAMPLES, render
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.texture import noise
from sim_devices.worlds.walls import build_world
from sim_devices.worlds.world import World

NEEDED, GOAL = 80.0, 25.0
WINDOW = Window(96, 112, 64, 32)


def scene() -> World:
    """Two walls that meet in a corner, and a textured patch that moves before them: three surfaces."""
    return World(
        [
            Rectangle(6.0, 4.0, noise(1024, 1), still(facing((3.0, 0.0, 0.0)))),
            Rectangle(4.0, 4.0, noise(1024, 2), still(facing((2.0, 1.2, 0.0), 1.2))),
            Rectangle(
                0.4, 0.4, noise(256, 3, mean=200.0), on_bearing(sine(0.2, 0.2), sine(0.1, 0.3), constant(1.5))
            ),
        ]
    )


def three_surfaces(size: int) -> Callable[[int], object]:
    """Render the k-th picture of the scene."""
    world, lens, camera = scene(), Optics.centred_deg(size, size, 60.0), facing((0.0, 0.0, 0.0))
    return lambda k: render(world, lens, camera, 0.01 * k)


def side_eye(window: Window) -> Callable[[int], object]:
    """Render the left eye's window of a base that passes through the funnel in 300 steps."""
    world, eye = build_world(read_plan("funnel")), side_eyes()[0]
    seat = eye.mount.placement() @ facing((0.0, 0.0, 0.0))

    def picture(k: int) -> object:
        base = Placement(position=np.array([0.01 * (k % 300), 0.0, 0.0]))
        return render(world, eye.optics, base @ seat, 0.0, window)

    return picture


def time_alternately(
    picture: Callable[[int], object], width: int, height: int, repeats: int
) -> tuple[float, float]:
    """Median milliseconds of one rendered picture and of one bare remap to the same samples."""
    texture = noise(1024, 1).levels[0]
    rows, columns = np.mgrid[0 : SAMPLES * height, 0 : SAMPLES * width].astype(np.float32)
    rows, columns = 1.3 * rows + 20, 1.3 * columns + 20
    pictures, remaps = [], []
    for k in range(repeats):
        start = time.perf_counter()
        picture(k)
        between = time.perf_counter()
        cv2.remap(texture, columns, rows, cv2.INTER_LINEAR)
        pictures.append(between - start)
        remaps.append(time.perf_counter() - between)
    return 1e3 * median(pictures), 1e3 * median(remaps)


def main(argv: list[str]) -> int:
    """Print a table; the exit code is 1 when a picture needs more than 80 bare remaps."""
    parser = argparse.ArgumentParser(prog="tools/bench render", description=__doc__)
    parser.add_argument("--repeats", type=int, default=300)
    parser.add_argument("--threads", type=int, default=0, help="OpenCV's threads; 0 leaves its own choice")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}, must be at least 1")
    if options.threads:
        cv2.setNumThreads(options.threads)
    rows, ratios = [], []
    for name, width, height, picture in (
        ("64²", 64, 64, three_surfaces(64)),
        ("128²", 128, 128, three_surfaces(128)),
        ("side eye 64 x 32", WINDOW.width, WINDOW.height, side_eye(WINDOW)),
    ):
        time_alternately(picture, width, height, 20)
        spent, remap = time_alternately(picture, width, height, options.repeats)
        rows.append({"picture": name, "picture_ms": spent, "remap_ms": remap, "ratio": spent / remap})
        ratios.append(spent / remap)
    if options.json:
        print(json.dumps(rows, indent=2))
    else:
        print(f"{SAMPLES} x {SAMPLES} samples a pixel; needed <= {NEEDED:g}, goal {GOAL:g}")
        for row in rows:
            print(
                f"{row['picture']:>16}  picture {row['picture_ms']:.3f} ms  bare remap {row['remap_ms']:.3f} ms  "
                f"ratio {row['ratio']:.1f}"
            )
    return int(any(ratio > NEEDED for ratio in ratios))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
