"""Rendering against one bare cv2.remap of the same size and sampling, run alternately.

Issue: 64² and 128² of a scene with three surfaces at most 80 times one bare remap; goal 25 times in NumPy.
"""

import argparse
import json
import sys
import time
from statistics import median

import cv2
import numpy as np

from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import constant, facing, on_bearing, sine, still
from sim_devices.worlds.render import SAMPLES, render
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.texture import noise
from sim_devices.worlds.world import World

NEEDED, GOAL = 80.0, 25.0


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


def time_alternately(size: int, repeats: int) -> tuple[float, float]:
    """Median milliseconds of one rendered picture and of one bare remap to the same samples."""
    world, lens, camera = scene(), Optics.centred_deg(size, size, 60.0), facing((0.0, 0.0, 0.0))
    texture = noise(1024, 1).levels[0]
    rows, columns = np.mgrid[0 : SAMPLES * size, 0 : SAMPLES * size].astype(np.float32)
    rows, columns = 1.3 * rows + 20, 1.3 * columns + 20
    pictures, remaps = [], []
    for k in range(repeats):
        start = time.perf_counter()
        render(world, lens, camera, 0.01 * k)
        between = time.perf_counter()
        cv2.remap(texture, columns, rows, cv2.INTER_LINEAR)
        pictures.append(between - start)
        remaps.append(time.perf_counter() - between)
    return 1e3 * median(pictures), 1e3 * median(remaps)


def main(argv: list[str]) -> int:
    """Print a table; the exit code is 1 when a size needs more than 80 bare remaps."""
    parser = argparse.ArgumentParser(prog="tools/bench render", description=__doc__)
    parser.add_argument("--repeats", type=int, default=300)
    parser.add_argument("--threads", type=int, default=0, help="OpenCV's threads; 0 leaves its own choice")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    if options.repeats < 1:
        parser.error(f"--repeats is {options.repeats}, must be at least 1")
    if options.threads:
        cv2.setNumThreads(options.threads)
    rows = []
    for size in (64, 128):
        time_alternately(size, 20)
        picture, remap = time_alternately(size, options.repeats)
        rows.append({"size": size, "picture_ms": picture, "remap_ms": remap, "ratio": picture / remap})
    if options.json:
        print(json.dumps(rows, indent=2))
    else:
        print(f"three surfaces, {SAMPLES} x {SAMPLES} samples a pixel; needed <= {NEEDED:g}, goal {GOAL:g}")
        for row in rows:
            print(
                f"{row['size']:>4}²  picture {row['picture_ms']:.3f} ms  bare remap {row['remap_ms']:.3f} ms  "
                f"ratio {row['ratio']:.1f}"
            )
    return int(any(row["ratio"] > NEEDED for row in rows))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
