"""Obstacles on the floor, chapter 4.3: heights over it, least height found without a false alarm, ROC, peers beside.

Writes figures and figures_of_merit.json; those that show real images stay in the output folder. What needs
../shared/data is skipped where that is absent.
"""

import argparse
import json
from pathlib import Path
from typing import Any

import cv2
import numpy as np

from perception.plane.departure import measure_departure
from perception.plane.direct import estimate_plane_motion
from perception.plane.plane_motion import BELIEVED
from perception.plane.template import Template
from perception.plane.window import Window
from tools.plane import floor_figures
from tools.plane.floor_scores import PEERS, FloorScore, score_floor, summarise
from tools.plane.floors import FloorCase, floor_flow_px
from tools.plane.images import DATA, read_grey
from tools.plane.wall_scores import in_processes

TEXTURES = ("noise 31 25", "noise 32 25", "noise 33 25", "noise 34 25")
GRAF = "planar_graf/graf1.png"
FIRST_SEED = 40_000
"""Of the images that are reported; others were looked at while the methods were made."""
DEPARTS_PX = 0.35
TOLERANCE_PX = 0.1
"""The lenses of the real images are not straightened."""
CUBE_STEP, CUBE_STARTS = 4, range(0, 76, 4)
UNDERWATER_PART, UNDERWATER_SHOWN = (0.65, 0.5), (2, 9, 16, 25, 33, 44)
"""Its lens bends lines: the middle columns are nearly straight."""


def floors() -> dict[str, tuple[tuple[str, ...], float, float, tuple[float, ...], bool]]:
    """Name: textures, step in m, pitch, heights of boxes over the camera's, peers."""
    return {
        "65°, 1.1 px": (TEXTURES, 0.004, 65.0, (0.05, 0.1, 0.2), True),
        "65°, 5.2 px": (TEXTURES, 0.02, 65.0, (0.01, 0.02, 0.04, 0.06, 0.1), True),
        "65°, 12.7 px": (TEXTURES, 0.05, 65.0, (0.005, 0.008, 0.015, 0.03, 0.1, 0.2), True),
        "65°, 24.5 px": (TEXTURES, 0.1, 65.0, (0.003, 0.005, 0.008, 0.02, 0.1, 0.2), True),
        "graf, 65°, 12.7 px": ((GRAF,), 0.05, 65.0, (0.005, 0.01, 0.02, 0.05), True),
        "30°, 5 cm": (TEXTURES, 0.05, 30.0, (0.05, 0.1, 0.2), False),
    }


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce floor", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/floor"), help="default: out/floor")
    parser.add_argument("--empty", type=int, default=100, help="empty images of each floor; default: 100")
    parser.add_argument("--boxes", type=int, default=40, help="boxes of each height; default: 40")
    parser.add_argument("--real-only", action="store_true", help="only the real images")
    arguments = parser.parse_args(argv)
    if min(arguments.empty, arguments.boxes) < 4:
        parser.error(f"--empty {arguments.empty}, --boxes {arguments.boxes}: at least 4 are needed")
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    merits = {} if arguments.real_only else rendered(out, arguments.empty, arguments.boxes)
    merits |= {"cube": cube(out), "underwater": underwater(out)}
    path = out / "figures_of_merit.json"
    path.write_text(json.dumps(merits, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(f"{path} and the figures beside it")
    return 0


def rendered(out: Path, empties: int, boxes: int) -> dict[str, Any]:
    """Boxes of 12 cm on rendered floors, camera at .5 m, noise of 2 grey levels."""
    tables: dict[str, tuple[float, dict[str, Any]]] = {}
    panels: dict[str, tuple[list[FloorScore], list[FloorScore]]] = {}
    for name, (textures, step, pitch, heights, peers) in floors().items():
        if GRAF in textures and not (DATA / GRAF).is_file():
            print(f"{name} skipped: {GRAF} is not in {DATA.parent.name}/{DATA.name}")
            continue
        empty = _score(textures, 0.0, step, pitch, empties, peers)
        found = {height: _score(textures, height, step, pitch, boxes, peers) for height in heights}
        tables[name] = (floor_flow_px(step, pitch), summarise(empty, found))
        print_floor(name, tables[name][1])
        if peers:
            shown = {"65°, 1.1 px": 0.1, "65°, 5.2 px": 0.06}.get(name, 0.02 if "graf" in name else 0.1)
            panels[f"{name}: h/H = {shown:g}"] = (empty, found[shown])
    floor_figures.draw_roc(out / "roc.png", panels)
    floor_figures.draw_least(out / "least.png", tables)
    floor_figures.draw_heights(
        out / "heights.png",
        {
            "no box": FloorCase(TEXTURES[0], 0.0, 0.05, 65.0, FIRST_SEED),
            "box of .4 cm, h/H = .008": FloorCase(TEXTURES[1], 0.008, 0.05, 65.0, FIRST_SEED + 500),
            "box of .75 cm, h/H = .015": FloorCase(TEXTURES[2], 0.015, 0.05, 65.0, FIRST_SEED + 501),
            "box of 2.5 cm, h/H = .05": FloorCase(TEXTURES[3], 0.05, 0.05, 65.0, FIRST_SEED + 502),
        },
    )
    return {name: {"floor_flow_px": round(flow, 2), **table} for name, (flow, table) in tables.items()}


def _score(
    textures: tuple[str, ...], height: float, step: float, pitch: float, number: int, peers: bool
) -> list[FloorScore]:
    first = FIRST_SEED + (500 if height else 0)
    cases = [FloorCase(textures[k % len(textures)], height, step, pitch, first + k) for k in range(number)]
    return in_processes(score_floor, [(case, peers) for case in cases])


def print_floor(name: str, table: dict[str, Any]) -> None:
    print(f"{name}: deviations of empty cells {table['spread']}")
    for method in ("heights over the floor", *PEERS):
        if method not in table:
            continue
        row = table[method]
        found = "  ".join(f"{height}: {part:.0f} %" for height, part in row["found_percent"].items())
        print(f"  {method:<32} limit {row['limit']:<8g} least {row['least_height']}   {found}")
    heights = "  ".join(
        f"{true}: {row['median']:.4f} ± {row['std']:.4f}" for true, row in table["heights"].items()
    )
    print(f"  heights, true: median ± stated    {heights}")


def cube(out: Path) -> list[dict[str, Any]]:
    """A real poster with a cube before it, lens and motion unknown: the largest region that moves otherwise."""
    names = [f"visp_cube_plane/image.{k:04d}.png" for k in range(80)]
    if read_grey(names[0]) is None:
        print(f"cube skipped: its folder is not in {DATA.parent.name}/{DATA.name}")
        return []
    found, rows = [], []
    for start in CUBE_STARTS:
        row, picture = _departure(names[start], names[start + CUBE_STEP])
        row["pair"] = f"{start} to {start + CUBE_STEP}"
        found.append(row)
        print(
            f"cube, {row['pair']:<9} flow {row['flow_px']:5.2f} px, inliers {row['inliers']:.2f}:"
            f" largest region {row['cells']} cells about {row['middle']}, next {row['next']}"
        )
        if start in (16, 20, 32, 44, 56, 68):
            rows.append((f"frames {row['pair']}", *picture))
    floor_figures.draw_real(out / "cube.png", rows)
    return found


def underwater(out: Path) -> list[dict[str, Any]]:
    """A crawler over a tiled pool floor with obstacles: shown, for there is no truth of them."""
    folder = DATA / "underwater_subvo"
    names = [str(path.relative_to(DATA)) for path in sorted(folder.glob("*.jpg"))]
    if not names:
        print(f"underwater skipped: its folder is not in {DATA.parent.name}/{DATA.name}")
        return []
    found, rows = [], []
    for start in range(len(names) - 1):
        row, picture = _departure(names[start], names[start + 1], *UNDERWATER_PART)
        row["pair"] = start
        found.append(row)
        if start in UNDERWATER_SHOWN and picture:
            rows.append((f"frame {start}: {100 * row['inliers']:.0f} % agree", *picture))
    floor_figures.draw_real(out / "underwater.png", rows)
    known = [row for row in found if row["inliers"] >= BELIEVED]
    print(f"underwater: the floor is believed in {len(known)} of {len(found)} pairs; largest region, cells:")
    for name, part in (("the rope in view, 0 to 29", range(30)), ("past it, 30 to 58", range(30, 59))):
        cells = [row["cells"] for row in known if row["pair"] in part]
        if cells:
            print(
                f"  {name}: median {np.median(cells):.0f}, {min(cells)} to {max(cells)} of {len(cells)} pairs"
            )
    return found


def _departure(
    first: str, second: str, rows_part: float = 1.0, columns_part: float = 1.0
) -> tuple[dict[str, Any], tuple[Any, ...]]:
    """What departs from the plane that most of the image shows, of its lowest rows and middle columns."""
    images = [read_grey(name) for name in (first, second)]
    one, other = (image for image in images if image is not None)
    top, left = (
        int(size * (1 - part)) for size, part in zip(one.shape, (rows_part, columns_part), strict=True)
    )
    seen_part = np.s_[top:, left // 2 : one.shape[1] - left // 2]
    one, other = one[seen_part], other[seen_part]
    window = Window.central(one.shape, one.shape[1] - 16, one.shape[0] - 16)
    template = Template(one, window)
    seen = estimate_plane_motion(template, other, tolerance_px=TOLERANCE_PX)
    if seen is None:
        return {"flow_px": float("nan"), "inliers": 0.0, "cells": 0, "next": 0, "middle": None}, ()
    departure = measure_departure(template, other, seen)
    regions = departure.regions(DEPARTS_PX)
    x, y = window.pixels()
    corners = np.stack((x.ravel(), y.ravel()), axis=-1)[None]
    moved = cv2.perspectiveTransform(corners, seen.homography) - corners
    flow = float(np.median(np.hypot(moved[..., 0], moved[..., 1])))
    row = {
        "flow_px": round(flow, 2),
        "inliers": round(seen.inliers, 2),
        "cells": regions[0].cells if regions else 0,
        "next": regions[1].cells if len(regions) > 1 else 0,
        "middle": [round(place) for place in regions[0].middle_px] if regions else None,
    }
    return row, (one, departure, DEPARTS_PX, regions[0].box_px if regions else None)
