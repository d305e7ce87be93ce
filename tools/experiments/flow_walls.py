"""Inverse depths of walls by lateral flow: straight, slanted, turning, under bad light, striped.

Prints tables and writes flow_walls.json. The walls' seeds, from 8000 on, chose nothing.
"""

import argparse
import json
import os
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from math import radians
from pathlib import Path

import cv2
import numpy as np

from perception.flow.lateral import LateralSettings
from tools.flow.drive import LEFT, RIGHT, Drive, Outcome, outcome
from tools.flow.walls import stripes

FIRST_SEED = 8000
IMAGES = 25
SLANTS = (0.0, 0.5, -0.7)
ROW, COLUMN = np.mgrid[0:40, 0:160]
LIGHTS: dict[str, Callable[[int], object]] = {
    "steady": lambda k: 1.0,
    "flicker to 70 %": lambda k: 0.7 if k % 2 else 1.0,
    "vignetting 40 %, window aside": lambda k: (
        1 - 0.4 * ((COLUMN + 20) ** 2 + (ROW + 60) ** 2) / (2 * 128**2)
    ),
    "a tenth of the light": lambda k: 0.1,
}
PERIODS_M = tuple(np.geomspace(0.01, 0.1, 11))


def walls(distance: float, turn_deg: float, contrast: float, seeds: int) -> Outcome:
    """Walls to both sides, straight and slanted."""
    cv2.setNumThreads(1)
    return outcome(
        [
            Drive(side, distance, slant, contrast=contrast, turn=radians(turn_deg), seed=FIRST_SEED + seed)
            for seed in range(seeds)
            for side in (LEFT, RIGHT)
            for slant in SLANTS
        ],
        IMAGES,
    )


def lights(name: str, contrast: float, seeds: int) -> Outcome:
    """Straight walls .7 m away under one light."""
    cv2.setNumThreads(1)
    light = LIGHTS[name]
    drives = [Drive(contrast=contrast, seed=FIRST_SEED + s, light=light) for s in range(3 * seeds)]  # type: ignore[arg-type]
    return outcome(drives, IMAGES)


def striped(period: float, nearest: float, seeds: int) -> Outcome:
    """Striped walls at random distances and slants; stripes of less than 2.2 px are left out."""
    cv2.setNumThreads(1)
    random = np.random.default_rng([FIRST_SEED, round(1e6 * period)])
    drives: list[Drive] = []
    while len(drives) < 6 * seeds:
        distance, slant = random.uniform(0.35, 1.5), random.uniform(-0.6, 0.6)
        rate, turn = random.choice([12.5, 25.0]), random.choice([0.0, 0.1])
        drive = Drive(
            distance=distance,
            slant=slant,
            levels=stripes(period, 0.5),
            rate=rate,
            turn=turn,
            seed=len(drives),
            settings=LateralSettings(nearest_m=nearest),
        )
        if 192 * period * np.cos(slant) / distance >= 2.2:
            drives.append(drive)
    return outcome(drives, IMAGES)


def row(got: Outcome) -> dict[str, float]:
    """Figures of one row, per cent; NaN where nothing was measured."""
    if not len(got.part):
        return {"found": 0.0, "wrong": 0}
    bias = float(np.median(got.part))
    size = np.abs(got.strength)
    return {
        "found": round(100 * len(got.part) / got.images, 1),
        "bias": round(100 * bias, 3),
        "deviation": round(148.26 * float(np.median(np.abs(got.part - bias))), 3),
        "cover_68": round(100 * float(np.mean(size < 1)), 1),
        "cover_95": round(100 * float(np.mean(size < 1.96)), 1),
        "wrong": int(np.sum(np.abs(got.part) > 0.1)),
    }


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce flow_walls", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/flow"), help="default: out/flow")
    parser.add_argument("--seeds", type=int, default=5, help="walls a row, times 3 or 6; default: 5")
    arguments = parser.parse_args(argv)
    if arguments.seeds < 1:
        parser.error(f"--seeds is {arguments.seeds}, must be at least 1")
    arguments.out.mkdir(parents=True, exist_ok=True)
    jobs: dict[str, Callable[[int], Outcome]] = {}
    for distance in (0.3, 0.7, 1.5, 3.0):
        for turn in (0.0, 7.0):
            for contrast in (0.5, 0.1):
                name = f"wall {distance:g} m, turn {turn:g} °/s, contrast {contrast:g}"
                jobs[name] = partial(walls, distance, turn, contrast)
    for light in LIGHTS:
        for contrast in (0.5, 0.1):
            jobs[f"{light}, contrast {contrast:g}"] = partial(lights, light, contrast)
    for nearest in (0.15, 0.3):
        for period in PERIODS_M:
            jobs[f"stripes {100 * period:.1f} cm, nearest {nearest:g} m"] = partial(striped, period, nearest)
    with ProcessPoolExecutor(os.cpu_count()) as pool:
        waiting = {name: pool.submit(job, arguments.seeds) for name, job in jobs.items()}
        result = {name: row(future.result()) for name, future in waiting.items()}
    print(f"{'':<48}found  bias    dev.   covers      wrong by > 10 %")
    for name, r in result.items():
        if r["found"]:
            covers = f"{r['cover_68']:.0f} / {r['cover_95']:.0f}"
            print(
                f"{name:<48}{r['found']:5.0f} {r['bias']:6.2f} {r['deviation']:6.2f}   {covers:<12}{r['wrong']}"
            )
        else:
            print(f"{name:<48}    0")
    path = arguments.out / "flow_walls.json"
    path.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
    print(path)
    return 0
