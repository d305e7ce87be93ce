"""Planes, chapter 4: time to contact, heading of a wall, robustness, honesty, normal flow, table 4.1; peers beside.

Writes figures and figures_of_merit.json. What needs ../shared/data is skipped where that is absent.
"""

import argparse
import json
from itertools import product
from pathlib import Path
from typing import Any

from tools.plane import wall_figures
from tools.plane.images import DATA
from tools.plane.normal_scores import read_pair, score_pair
from tools.plane.table_4_1 import run as run_table
from tools.plane.wall_scores import (
    GRAF,
    OURS,
    STEPS_TO_CONTACT,
    STEPS_TO_WALL,
    YAWS_DEG,
    Contact,
    cases,
    cover,
    in_processes,
    median_percent,
    score_changed,
    score_contact,
    score_heading,
    summarise_contact,
)

FIRST_SEED = 7000
"""Of the images that are reported; others were looked at while the methods were made."""
OTHERS = ("tum_fr1desk9/rgb", "vergence_genuapesto")
"""Folders whose first image is one more texture for the stated deviations."""


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce plane", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/plane"), help="default: out/plane")
    parser.add_argument("--pairs", type=int, default=40, help="pairs of images of each case; default: 40")
    parser.add_argument("--trials", type=int, default=1000, help="draws of table 4.1; default: 1000")
    arguments = parser.parse_args(argv)
    if arguments.pairs < 4 or arguments.trials < 4:
        parser.error(f"--pairs {arguments.pairs}, --trials {arguments.trials}: at least 4 are needed")
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    merits: dict[str, Any] = {"table 4.1": run_table(arguments.trials)}
    wall_figures.draw_inverse_perspective(out / "inverse_perspective.png")
    print_table_4_1(merits["table 4.1"])
    if (DATA / GRAF).is_file():
        merits |= walls(out, arguments.pairs)
    else:
        print(f"walls skipped: {GRAF} is not in {DATA.parent.name}/{DATA.name}")
    merits["normal flow"] = normal_flow()
    path = out / "figures_of_merit.json"
    path.write_text(json.dumps(merits, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{path} and the figures beside it")
    return 0


def walls(out: Path, pairs: int) -> dict[str, Any]:
    """Everything that is measured on the wall with the texture graf1."""
    seeds = range(FIRST_SEED, FIRST_SEED + pairs)
    contacts = _grouped(score_contact, [(GRAF, *case) for case in product(YAWS_DEG, STEPS_TO_CONTACT)], seeds)
    table = summarise_contact({(yaw, steps): found for (_, yaw, steps), found in contacts.items()})
    print_contact(table)
    wall_figures.draw_contact(out / "contact.png", table)
    headings = _grouped(score_heading, [(GRAF, *case) for case in product(YAWS_DEG, STEPS_TO_WALL)], seeds)
    heading_table = summarise_heading(headings)
    print_heading(heading_table)
    changed = {
        case: in_processes(score_changed, [(GRAF, case, yaw, seed) for yaw in YAWS_DEG for seed in seeds])
        for case in cases()
    }
    changed_table = {case: summarise_changed(found) for case, found in changed.items()}
    print_changed(changed_table)
    wall_figures.draw_changed(out / "changed.png", changed)
    deviations = {
        "time to contact": [one[OURS].deviations for found in contacts.values() for one in found],
        "heading of a wall": [one["deviations"] for found in headings.values() for one in found],
        "time to contact, poorer or otherwise lit": [
            one[OURS].deviations for case, found in changed.items() if "obstacle" not in case for one in found
        ],
        "time to contact, other textures": other_textures(pairs),
    }
    wall_figures.draw_honesty(out / "honesty.png", deviations)
    coverage = {name: [round(part, 1) for part in cover(off)] for name, off in deviations.items() if off}
    print("within 1 and 1.96 stated deviations")
    for name, parts in coverage.items():
        print(f"  {name:<44}{parts[0]:6.1f} {parts[1]:6.1f} %")
    return {
        "time to contact": table,
        "heading of a wall": heading_table,
        "changed": changed_table,
        "coverage": coverage,
    }


def other_textures(pairs: int) -> list[float]:
    """Deviations of the time to contact on textures that nothing was tuned on."""
    textures = [sorted((DATA / folder).glob("*.png")) for folder in OTHERS]
    names = [str(paths[0].relative_to(DATA)) for paths in textures if paths]
    jobs = [
        (name, yaw, steps, seed)
        for name in names
        for yaw, steps in product(YAWS_DEG, (50, 10))
        for seed in range(FIRST_SEED, FIRST_SEED + pairs // 2)
    ]
    return [found[OURS].deviations for found in in_processes(score_contact, jobs)]


def normal_flow() -> dict[str, Any]:
    """RubberWhale and Venus, each skipped where it is absent."""
    table: dict[str, Any] = {}
    for name in ("RubberWhale", "Venus"):
        pair = read_pair(name)
        if pair is None:
            print(f"{name} skipped: it is not in {DATA.parent.name}/{DATA.name}")
            continue
        table[name] = score_pair(pair)
        print(f"normal flow, {name}: median and mean error px, within 1 and 1.96 deviations %")
        for method, score in table[name].items():
            print(f"  {method:<22}" + "  ".join(f"{value:g}" for value in score.values()))
    return table


def summarise_heading(scores: dict[tuple[Any, ...], list[dict[str, float]]]) -> dict[str, Any]:
    """Median error in degrees by method, of the distance in per cent, coverage and disagreement of ours."""
    table: dict[str, Any] = {}
    for (_, heading, ratio), found in scores.items():
        for name in found[0]:
            values = [one[name] for one in found]
            case = f"heading {heading}, {ratio}"
            if name == "deviations":
                continue
            if name == "distance":
                table.setdefault("distance, %", {})[case] = round(median_percent(values), 3)
            else:
                table.setdefault(name, {})[case] = round(median_percent(values) / 100, 3)
    table["cover_68_95"] = [
        round(part, 1) for part in cover(one["deviations"] for found in scores.values() for one in found)
    ]
    return table


def summarise_changed(scores: list[dict[str, Contact]]) -> dict[str, Any]:
    """Median error of every method in per cent, coverage, and how often ours is not believed."""
    ours = [one[OURS] for one in scores]
    return {
        "median_percent": {
            name: round(median_percent(one[name].error for one in scores), 3) for name in scores[0]
        },
        "believed_median_percent": round(
            median_percent([one.error for one in ours if one.believed] or [float("nan")]), 3
        ),
        "not_believed_percent": round(100 * sum(not one.believed for one in ours) / len(ours), 1),
        "cover_68_95": [round(part, 1) for part in cover(one.deviations for one in ours)],
    }


def print_table_4_1(table: dict[str, dict[str, float]]) -> None:
    print(f"{'table 4.1':<50}slant             tilt")
    for name, row in table.items():
        angles = (f"{row[f'{angle}_mean']:7.2f} ± {row[f'{angle}_std']:.2f}" for angle in ("slant", "tilt"))
        print(f"  {name:<48}" + "  ".join(angles))


def print_contact(table: dict[str, Any]) -> None:
    print("time to contact, median error %" + "".join(f"{steps:>8}" for steps in STEPS_TO_CONTACT))
    for name, row in table.items():
        if name == "cover_68_95":
            continue
        for yaw in YAWS_DEG:
            values = (row[f"yaw {yaw}, {steps}"]["median_percent"] for steps in STEPS_TO_CONTACT)
            print(f"  {name:<26} yaw {yaw:<4}" + "".join(f"{value:8.2f}" for value in values))


def print_heading(table: dict[str, Any]) -> None:
    print("heading of a wall, median error °" + "".join(f"{ratio:>8}" for ratio in STEPS_TO_WALL))
    for name, row in table.items():
        if name == "cover_68_95":
            continue
        for heading in YAWS_DEG:
            values = (row[f"heading {heading}, {ratio}"] for ratio in STEPS_TO_WALL)
            print(f"  {name:<26} at {heading:<6}" + "".join(f"{value:8.3f}" for value in values))


def print_changed(table: dict[str, Any]) -> None:
    print(
        "25 steps to contact, median error %: ours, Farnebäck, DIS medium; of those believed; not believed; coverage"
    )
    for case, row in table.items():
        values = "".join(f"{value:8.2f}" for value in row["median_percent"].values())
        cover_68, cover_95 = row["cover_68_95"]
        print(
            f"  {case:<24}{values}{row['believed_median_percent']:9.2f}{row['not_believed_percent']:8.1f} %"
            f"{cover_68:8.1f}{cover_95:7.1f}"
        )


def _grouped(work: Any, cases_: list[tuple[Any, ...]], seeds: range) -> dict[tuple[Any, ...], list[Any]]:
    jobs = [(*case, seed) for case in cases_ for seed in seeds]
    found = in_processes(work, jobs)
    return {case: found[k * len(seeds) : (k + 1) * len(seeds)] for k, case in enumerate(cases_)}
