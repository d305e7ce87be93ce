"""Lateral flow of a 64×32 window: bias and deviation beside DIS, Farnebäck and the thesis's filter; bare walls.

Prints tables and writes flow_window.json. The textures 2000 to 2059 chose nothing.
"""

import argparse
import json
import os
from collections import defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import cv2
import numpy as np

from perception.flow.window import Window
from tools.flow.bare import BARE, false_flows
from tools.flow.methods import FRAMES, OURS, Found, Trial, peers
from tools.flow.score import Score, score
from tools.flow.textures import CONTRAST, MEAN, Texture, sense

FIRST_SEED = 2000
SHIFTS = tuple((u, 0.5) for u in (0.15, 0.3, 0.61, 1.02, 1.92, 2.75, 3.84, 5.12, 7.3, 9.6, 14.7, 19.2))
CONTRASTS = tuple((shift, c) for shift in (1.02, 4.3) for c in (0.05, 0.1, 0.2, 1.0))
MARGIN = 32
ROWS = 96
WHOLE = Window(96, 32)
PREDICTION = (0.2, 0.5)
"""An odometry's guess is off by this part of the shift and this many px, standard deviations."""


def make_trial(texture: Texture, seed: int, flow_px: float, contrast: float, only_window: bool) -> Trial:
    """Five frames of a texture, noise of its own in each."""
    random = np.random.default_rng([seed, round(1000 * flow_px), round(1000 * contrast)])
    frames = [sense(MEAN + CONTRAST * contrast * texture.moved(k * flow_px), random) for k in range(FRAMES)]
    part, absolute = PREDICTION
    predicted = flow_px * (1 + part * random.standard_normal()) + absolute * random.standard_normal()
    if only_window:
        rows = slice(WHOLE.top, WHOLE.top + WHOLE.height)
        frames = [np.ascontiguousarray(f[rows, WHOLE.left : WHOLE.left + WHOLE.width]) for f in frames]
    return Trial(tuple(frames), Window(0, 0) if only_window else WHOLE, flow_px, predicted)


def measure(job: tuple[int, bool, float]) -> dict[tuple[str, float, float], Found]:
    """Everything about one texture, on one processor."""
    cv2.setNumThreads(1)
    seed, only_window, lens_px = job
    texture = Texture(seed, ROWS, lens_px)
    methods = {**OURS, **peers(0 if only_window else MARGIN)}
    found = {}
    for flow_px, contrast in SHIFTS + CONTRASTS:
        trial = make_trial(texture, seed, flow_px, contrast, only_window)
        found.update({(name, flow_px, contrast): method(trial) for name, method in methods.items()})
    return found


def table(only_window: bool, lens_px: float, seeds: int) -> dict[tuple[str, float, float], Score]:
    """Scores of all methods, shifts and contrasts over the seeds."""
    jobs = [(seed, only_window, lens_px) for seed in range(FIRST_SEED, FIRST_SEED + seeds)]
    gathered: dict[tuple[str, float, float], list[Found]] = defaultdict(list)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        for found in pool.map(measure, jobs):
            for key, value in found.items():
                gathered[key].append(value)
    return {key: score(values, key[1]) for key, values in gathered.items()}


def show(title: str, scores: dict[tuple[str, float, float], Score]) -> None:
    """One row a shift and contrast: bias / deviation of every method, – where it gives less than half of the flows."""
    names = list(dict.fromkeys(name for name, _, _ in scores))
    print(f"\n{title}: bias / deviation, per cent of the flow\n")
    print("| px | c | " + " | ".join(names) + " | warped covers |")
    print("|" + "---|" * (len(names) + 3))
    for flow_px, contrast in SHIFTS + CONTRASTS:
        cells = []
        for name in names:
            s = scores[name, flow_px, contrast]
            cells.append(f"{s.bias:.1f} / {s.deviation:.2g}" if s.found >= 50 else "–")
        s = scores["warped", flow_px, contrast]
        print(
            f"| {flow_px:g} | {contrast:g} | "
            + " | ".join(cells)
            + f" | {s.cover_68:.0f} / {s.cover_95:.0f} |"
        )


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce flow_window", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/flow"), help="default: out/flow")
    parser.add_argument("--seeds", type=int, default=60, help="textures, from seed 2000 on; default: 60")
    parser.add_argument(
        "--windows", type=int, default=10000, help="bare windows of each kind; default: 10000"
    )
    arguments = parser.parse_args(argv)
    if arguments.seeds < 2:
        parser.error(f"--seeds is {arguments.seeds}, must be at least 2")
    if arguments.windows < 1:
        parser.error(f"--windows is {arguments.windows}, must be at least 1")
    arguments.out.mkdir(parents=True, exist_ok=True)
    result: dict[str, object] = {}
    for title, only_window, lens_px in (
        ("32 px around the window", False, 0.5),
        ("nothing but the window", True, 0.5),
        ("32 px around the window, no lens blur: what the pixels cannot resolve folds back", False, 0.0),
    ):
        scores = table(only_window, lens_px, arguments.seeds)
        show(title, scores)
        result[title] = {f"{n}, {u:g} px, c {c:g}": s.to_json() for (n, u, c), s in scores.items()}
    print("\nFalse flows of bare windows with noise: warped, one pass\n")
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        counts = dict(zip(BARE, pool.map(false_flows, BARE, [arguments.windows] * len(BARE)), strict=True))
    for name, (by_warped, by_one_pass) in counts.items():
        print(f"{name:<34}{by_warped:>6}{by_one_pass:>6} of {arguments.windows}")
    result["bare"] = {"windows": arguments.windows, **counts}
    path = arguments.out / "flow_window.json"
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0
