"""Depth from motion: whether the stated deviations are true on other textures and motions than those of `depth`.

Prints, from the least to the greatest over the seeds, how many per cent of the errors lie within 1 and 1.96 stated
deviations; required are 60-76 and 91-98. Writes depth_honesty.json.
"""

import argparse
import json
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from pathlib import Path

import cv2

from perception.depth import DEFAULT
from tools.depth.scenes import Sequence, approach, sea_bed, slanted_plane, table_top
from tools.depth.score import cover_sequence

flight = partial(slanted_plane, noise=1.0, size=(256, 192), slant=0.4)
SCENES: dict[str, Callable[..., Sequence]] = {
    "plane": slanted_plane,
    "plane, noise 2": partial(slanted_plane, noise=2.0),
    "plane, noise 4": partial(slanted_plane, noise=4.0),
    "plane, slanted by 46 deg, noise 2": partial(slanted_plane, noise=2.0, slant=0.8),
    "plane, slanted by 63 deg, noise 1": partial(slanted_plane, noise=1.0, slant=1.1),
    "plane, parallel, no noise": partial(slanted_plane, slant=0.0),
    "plane, parallel, noise 1": partial(slanted_plane, slant=0.0, noise=1.0),
    "table-top": table_top,
    "table-top, 192x144": partial(table_top, size=(192, 144)),
    "sea bed, 192x144": partial(sea_bed, size=(192, 144)),
    "sea bed, 192x144, contrast 5": partial(sea_bed, size=(192, 144), contrast=5.0),
    "forward": partial(flight, step=(0.0, 0.1)),
    "forward, noise 4": partial(flight, step=(0.0, 0.1), noise=4.0),
    "forward and to the side": partial(flight, step=(0.05, 0.08)),
    "to the side, turning": partial(flight, step=(0.06, 0.0), yaw=0.03),
    "backward": partial(flight, step=(0.0, -0.1)),
}


def measure(job: tuple[str, int]) -> tuple[float, float]:
    """The coverage of one scene with one texture, on one processor."""
    name, seed = job
    cv2.setNumThreads(1)
    return cover_sequence(SCENES[name](seed=seed), DEFAULT)


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce depth_honesty", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/depth"), help="default: out/depth")
    parser.add_argument(
        "--seeds", type=int, default=8, help="textures of each scene, from seed 2 on; default: 8"
    )
    arguments = parser.parse_args(argv)
    if arguments.seeds < 1:
        parser.error(f"--seeds is {arguments.seeds}, must be at least 1")
    arguments.out.mkdir(parents=True, exist_ok=True)
    jobs = [(name, seed) for name in SCENES for seed in range(2, 2 + arguments.seeds)]
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        covers = dict(zip(jobs, pool.map(measure, jobs), strict=True))
    result = {name: [cover for (scene, _), cover in covers.items() if scene == name] for name in SCENES}
    result["a floor ahead"] = [cover_sequence(approach(), DEFAULT)]
    print(f"{'scene':<36}within 1 deviation   within 1.96")
    for name, found in result.items():
        ranges = [(min(part), max(part)) for part in zip(*found, strict=True)]
        print(f"{name:<36}" + "   ".join(f"{least:6.1f} - {most:5.1f} %" for least, most in ranges))
    path = arguments.out / "depth_honesty.json"
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0
