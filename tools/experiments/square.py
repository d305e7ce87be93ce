"""The Labmate's square both ways: published closing errors, calibration, the calibrated square, a bump.

Through the base's driver against the emulated base, in virtual time. Writes square.png, labmate-calibration.toml
and figures_of_merit.json, each figure beside its closed form or published value.
"""

import argparse
import asyncio
import json
import random
from math import degrees, radians, sqrt
from pathlib import Path
from statistics import median
from typing import Any

from labmate.calibration import Run, closing_of, estimate_closed_form, predict_closing
from labmate.config import write_calibration
from labmate.odometry import Pose, WheelGeometry
from labmate.simulation import run_virtual, simulated_base
from labmate.square import SquareResult, calibrate, run_experiment, true_end
from labmate.square_report import CALIBRATION_NAME, FIGURE_NAME, draw, summary
from sim_devices.labmate import BaseConfig as EmulatedConfig

SIDE = 4.0
TAPE_M = 0.002
DRAWS = 40
PUBLISHED_MM = {"ccw": 306.0, "cw": 15.0, "calibrated": 21.0}


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce square", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/square"), help="default: out/square")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args(argv)
    out: Path = arguments.out
    result, true = run_virtual(squares(arguments.seed))
    merits: dict[str, Any] = summary(result, true)
    merits["published_mm"] = PUBLISHED_MM
    merits["closed_form_closing_mm"] = {
        direction: 1e3 * predict_closing(direction, SIDE, result.nominal, true).distance
        for direction in ("ccw", "cw")
    }
    merits["closed_form_calibration"] = closed_form(result)
    merits["measured_with_a_tape"] = measured_with_a_tape(result, arguments.seed)
    merits["bump_of_10_mm_deg"] = {wheel: run_virtual(bump(wheel)) for wheel in ("left", "right")}
    merits["motions"] = run_virtual(motions())
    out.mkdir(parents=True, exist_ok=True)
    (out / "figures_of_merit.json").write_text(json.dumps(merits, indent=1) + "\n", encoding="utf-8")
    draw(out / FIGURE_NAME, result)
    write_calibration(
        out / CALIBRATION_NAME,
        result.calibration,
        result.nominal.wheel_base,
        50_000,
        "tools/reproduce square",
    )
    print_merits(merits)
    print(f"{out}/figures_of_merit.json, {FIGURE_NAME} and {CALIBRATION_NAME} beside it")
    return 0


async def squares(seed: int) -> tuple[SquareResult, WheelGeometry]:
    """Both ways, calibrated, both ways again."""
    async with simulated_base(seed) as sim, sim.open() as base:
        return await run_experiment(base, SIDE, sim.true_pose), sim.true_geometry()


def closed_form(result: SquareResult) -> dict[str, float]:
    """What UMBmark's first order alone gives from the same closing errors."""
    closings = [result.closing(run) for run in result.uncalibrated]
    found = estimate_closed_form(closings, SIDE, result.nominal)
    return {"wheel_base_mm": 1e3 * found.wheel_base, "wheel_ratio": found.wheel_ratio}


def measured_with_a_tape(result: SquareResult, seed: int) -> dict[str, float]:
    """Closing errors of the calibrated odometry when the true ends were measured to ±2 mm by hand, one run each way."""
    rng = random.Random(seed)
    distances, bases, ratios = [], [], []
    for _ in range(DRAWS):
        ends = [
            (run, Pose(end.x + rng.gauss(0.0, TAPE_M), end.y + rng.gauss(0.0, TAPE_M), end.heading))
            for run in result.uncalibrated
            for end in (true_end(run),)
        ]
        found = calibrate(ends, result.nominal, TAPE_M)
        bases.append(1e3 * found.wheel_base)
        ratios.append(found.wheel_ratio)
        geometry = found.geometry(result.nominal.counts_per_metre)
        distances += [
            1e3 * closing_of(Run(run.direction, run.track, true_end(run)), geometry).distance
            for run in result.calibrated
        ]

    def deviation(values: list[float]) -> float:
        mean = sum(values) / len(values)
        return sqrt(sum((value - mean) ** 2 for value in values) / (len(values) - 1))

    return {
        "tape_mm": 1e3 * TAPE_M,
        "closing_median_mm": median(distances),
        "closing_worst_mm": max(distances),
        "wheel_base_deviation_mm": deviation(bases),
        "wheel_ratio_deviation": deviation(ratios),
    }


async def bump(wheel: str) -> float:
    """Turn of the heading (degrees, unseen by the odometry) by a 10 mm bump under one wheel."""
    even = EmulatedConfig(wheel_base=0.340, diameter_ratio=1.0)
    async with simulated_base(0, emulated=even) as sim, sim.open() as base:
        await base.go(0.5)
        sim.bench.inject("base.bump", wheel=wheel, height=0.010)
        await base.go(1.0)
        return degrees(sim.true_pose().heading - (await base.read()).pose.heading)


async def motions() -> dict[str, float]:
    """Worst ends of GO and TURN by the base's own odometry, and a turn rate of 7.1°/s as held over 10 s."""
    async with simulated_base(0) as sim, sim.open() as base:
        go = [abs((await base.go(way)).travelled - way) for way in (2.0, -1.3, 0.5, 0.0203)]
        turn = [abs((await base.turn(radians(a))).travelled - radians(a)) for a in (90.0, -45.0, 5.0, 200.0)]
        async with base.motion() as motion:
            for tick in range(120):
                motion.twist(0.08, radians(7.1))
                if tick == 20:
                    before = await base.read()
                await asyncio.sleep(0.1)
            after = await base.read()
    return {
        "go_worst_mm": 1e3 * max(go),
        "turn_worst_deg": degrees(max(turn)),
        "turn_rate_asked_deg_s": 7.1,
        "turn_rate_held_deg_s": degrees(after.own_pose.heading - before.own_pose.heading)
        / (after.stamp - before.stamp),
    }


def print_merits(merits: dict[str, Any]) -> None:
    """The table of the experiment."""
    tape, moved = merits["measured_with_a_tape"], merits["motions"]
    runs = {
        (run["direction"], run["driven_by"].split()[0]): run["closing_mm"]["distance"]
        for run in merits["runs"]
    }
    rows = [
        (
            "closing ccw, mm",
            runs["ccw", "nominal"],
            f"closed form {merits['closed_form_closing_mm']['ccw']:.1f}, 306",
        ),
        (
            "closing cw, mm",
            runs["cw", "nominal"],
            f"closed form {merits['closed_form_closing_mm']['cw']:.1f}, 15",
        ),
        ("calibrated ccw, mm", runs["ccw", "calibrated"], "published about 21, criterion 25"),
        ("calibrated cw, mm", runs["cw", "calibrated"], "published about 21, criterion 25"),
        ("the same, ends taped to 2 mm", tape["closing_median_mm"], f"worst {tape['closing_worst_mm']:.1f}"),
        (
            "wheel base, mm",
            merits["calibration"]["wheel_base_mm"],
            f"true {merits['true']['wheel_base_mm']:.1f}",
        ),
        ("right/left", merits["calibration"]["wheel_ratio"], f"true {merits['true']['wheel_ratio']:.5f}"),
        ("bump of 10 mm, left, °", merits["bump_of_10_mm_deg"]["left"], "published about 0.6"),
        ("GO, worst, mm", moved["go_worst_mm"], "criterion 2"),
        ("TURN, worst, °", moved["turn_worst_deg"], "criterion 0.1"),
        ("7.1°/s as held", moved["turn_rate_held_deg_s"], "criterion 1 %"),
    ]
    for name, value, beside in rows:
        print(f"{name:<30}{value:>12.7g}   {beside}")
