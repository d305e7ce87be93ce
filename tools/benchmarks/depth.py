"""Depth from motion: milliseconds a frame beside StereoSGBM and DIS on the same images, in turns, in one run.

Issue: 640×480 at most 250 ms, 384×288 at most 80 ms on two cores, at most 400 MB, linear in the pixels.
"""

import argparse
import json
import resource
import sys
import time
from statistics import median

import cv2
import numpy as np

from perception.depth import DEFAULT, DepthFromMotion, Pinhole
from tools.depth.scenes import Plane, Scene, Sequence, place, render_sequence, waves

SIZES = ((192, 144), (256, 192), (384, 288), (512, 384), (640, 480))
LIMIT_MS = {640: 250.0, 384: 80.0}
LIMIT_MB = 400.0
DISPARITIES = 32


def scene(size: tuple[int, int], frames: int, turning: bool = False) -> Sequence:
    """A board before a slanted wall; the wall moves by 8 px and the board by 16 px a frame at every size.

    A camera that is `turning` also goes forward, so that planes are warped and not only shifted.
    """
    focal = float(size[0])
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
    wall = Plane((0, 0, 2), (float(np.cos(0.3)), 0, float(np.sin(0.3))), (0, 1, 0))
    board = Plane((0.1, 0.0, 1.0), (1, 0, 0), (0, 1, 0), (0.15, 0.15))
    surfaces = Scene((wall, board), waves(1, 12 / focal, 0.5, count=12))
    yaw, forward = (0.004, 0.01) if turning else (0.0, 0.0)
    poses = [place(16 * k / focal, 0, forward * k, yaw=yaw * k) for k in range(frames)]
    return render_sequence("bench", surfaces, camera, size, poses, noise=1.0, samples=1)


def time_in_turns(sequence: Sequence) -> dict[str, float]:
    """Median milliseconds of a frame of ours (the first, which searches everything, left out), SGBM and DIS."""
    estimator = DepthFromMotion(sequence.camera, DEFAULT)
    estimator.start(sequence.images[0])
    sgbm = cv2.StereoSGBM.create(
        0, DISPARITIES, 5, 200, 800, 1, 0, 10, 100, 2, cv2.STEREO_SGBM_MODE_SGBM_3WAY
    )
    dis = cv2.DISOpticalFlow.create(cv2.DISOPTICAL_FLOW_PRESET_MEDIUM)
    times: dict[str, list[float]] = {"ours": [], "SGBM": [], "DIS": []}
    pairs = zip(sequence.images, sequence.images[1:], sequence.motions, strict=False)
    for before, now, motion in pairs:
        start = time.perf_counter()
        estimator.step(now, motion)
        times["ours"].append(time.perf_counter() - start)
        start = time.perf_counter()
        sgbm.compute(before, now)
        times["SGBM"].append(time.perf_counter() - start)
        start = time.perf_counter()
        dis.calc(before, now, np.zeros((*now.shape, 2), np.float32))
        times["DIS"].append(time.perf_counter() - start)
    return {
        "first": 1e3 * times["ours"][0],
        **{name: 1e3 * median(values[1:]) for name, values in times.items()},
    }


def main(argv: list[str]) -> int:
    """Print a table; the exit code is 1 when a limit is passed."""
    parser = argparse.ArgumentParser(prog="tools/bench depth", description=__doc__)
    parser.add_argument("--frames", type=int, default=8)
    parser.add_argument("--threads", type=int, default=2, help="threads of OpenCV for all three")
    parser.add_argument("--turning", action="store_true", help="a camera that turns and goes forward too")
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args(argv)
    if options.frames < 3:
        parser.error(f"--frames is {options.frames}, must be at least 3")
    if options.threads < 1:
        parser.error(f"--threads is {options.threads}, must be at least 1")
    cv2.setNumThreads(options.threads)
    rows: list[dict[str, float]] = []
    for size in SIZES:
        found = time_in_turns(scene(size, options.frames, options.turning))
        pixels = size[0] * size[1]
        rows.append(
            {"width": size[0], "height": size[1], **found, "ns_a_pixel": 1e6 * found["ours"] / pixels}
        )
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    slopes = np.polyfit(
        np.log([r["width"] * r["height"] for r in rows]), np.log([r["ours"] for r in rows]), 1
    )
    result = {"rows": rows, "peak_mb": peak, "power_of_pixels": float(slopes[0])}
    if options.json:
        print(json.dumps(result, indent=2))
    else:
        print("size        ours ms  (first)   SGBM ms   DIS ms  ours/SGBM  ours/DIS  ns a pixel   limit")
        for row in rows:
            limit = LIMIT_MS.get(int(row["width"]))
            print(
                f"{row['width']:>4}×{row['height']:<5}{row['ours']:>8.1f}{row['first']:>9.1f}{row['SGBM']:>10.1f}"
                f"{row['DIS']:>9.1f}{row['ours'] / row['SGBM']:>11.1f}{row['ours'] / row['DIS']:>10.1f}"
                f"{row['ns_a_pixel']:>12.0f}" + (f"   {limit:g} ms" if limit else "")
            )
        print(f"peak memory {peak:.0f} MB of the whole process, limit {LIMIT_MB:g} MB")
        print(f"cost grows as the pixels to the power of {slopes[0]:.2f}")
    late = any(row["ours"] > LIMIT_MS.get(int(row["width"]), np.inf) for row in rows)
    return int(late or peak > LIMIT_MB)


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
