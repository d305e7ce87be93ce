"""Depth from motion: counterparts of figures 2.10–2.13, honesty, light, and the real images beside OpenCV.

Writes figures and figures_of_merit.json. The figures sea_bed, table_top, frames and light are of rendered scenes;
those that show real images stay in the output folder. Where ../shared/data is absent the real part is skipped.
"""

import argparse
import json
from pathlib import Path
from statistics import mean
from typing import Any

from tools.depth import figures
from tools.depth.real import score_five_views, score_hand_held, score_light_of_pair, score_pairs
from tools.depth.real_images import DATA, read_cones, read_tsukuba, read_tum
from tools.depth.rendered import (
    scenes,
    score_edges_of_table,
    score_light,
    score_planes,
    score_scene,
    score_turn,
)

LAST = -1


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce depth", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/depth"), help="default: out/depth")
    parser.add_argument("--rendered-only", action="store_true", help="leave the real images out")
    arguments = parser.parse_args(argv)
    out: Path = arguments.out
    out.mkdir(parents=True, exist_ok=True)
    merits = {"rendered": rendered(out), "real": {} if arguments.rendered_only else real(out)}
    if not arguments.rendered_only:
        figures.draw_coverage(out / "coverage.png", coverage(merits))
    path = out / "figures_of_merit.json"
    path.write_text(json.dumps(merits, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print_merits(merits)
    print(f"{path} and the figures beside it")
    return 0


def rendered(out: Path) -> dict[str, Any]:
    """Planes, table-top, sea bed, stripes, light."""
    merits: dict[str, Any] = {"plane": score_planes()}
    table, bed = scenes()
    merits["table-top"], table_maps = score_scene(table)
    merits["table-top, by edges"] = score_edges_of_table(table, table_maps["default"])
    merits["sea bed"], bed_maps = score_scene(bed)
    merits["turn"] = score_turn()
    merits["light"] = score_light()
    figures.draw_scene(
        out / "sea_bed.png",
        "A sea bed seen by a sinking camera: 1 m/s, a picture every .4 s, light ±20 % (figures 2.10, 2.11)",
        bed,
        bed_maps,
        7,
        16,
    )
    figures.draw_scene(
        out / "table_top.png",
        "A table-top, the camera moving right, then up (figures 2.12, 2.13)",
        table,
        table_maps,
        0.9,
        2.5,
    )
    figures.draw_frames(
        out / "frames.png",
        {
            "plane": merits["plane"]["noise 0, default"],
            "plane, σ = 2": merits["plane"]["noise 2, default"],
            "table-top": merits["table-top"]["default"],
            "sea bed": merits["sea bed"]["default"],
        },
        merits["turn"],
    )
    figures.draw_light(out / "light.png", {"rendered table-top": merits["light"]})
    return merits


def real(out: Path) -> dict[str, Any]:
    """Tsukuba, Cones and TUM, each skipped where its folder is absent."""
    merits: dict[str, Any] = {}
    tables = {}
    for views in (read_tsukuba(), read_cones()):
        if views is None:
            continue
        part: dict[str, Any] = {"pair": score_pairs(views), "light": score_light_of_pair(views)}
        if len(views.images) == 5:
            part["five views"] = score_five_views(views)
        merits[views.name], tables[views.name] = part, part["light"]
    hand_held = read_tum()
    if hand_held is not None:
        merits[hand_held.name] = score_hand_held(hand_held)
    for name in ("Tsukuba", "Cones", "TUM fr1/desk"):
        if name not in merits:
            print(f"{name} skipped: its folder is not in {DATA.parent.name}/{DATA.name}")
    if tables:
        figures.draw_light(out / "light_real.png", tables)
    return merits


def coverage(merits: dict[str, Any]) -> dict[str, tuple[float, float]]:
    """Per cent of the errors within one and 1.96 deviations: rendered ones over the sequence, real ones at its end."""
    shown, real_ones = merits["rendered"], merits["real"]
    runs = {
        "plane": shown["plane"]["noise 0, default"],
        "plane, σ = 2": shown["plane"]["noise 2, default"],
        "table-top": shown["table-top"]["default"],
        "sea bed": shown["sea bed"]["default"],
    }
    covers = {
        name: (mean(s["cover_68"] for s in scores), mean(s["cover_95"] for s in scores))
        for name, scores in runs.items()
    }
    ends = {}
    if "Tsukuba" in real_ones:
        ends["Tsukuba, five views"] = real_ones["Tsukuba"]["five views"]["reference frame 3"][LAST]
    if "Cones" in real_ones:
        ends["Cones, pair"] = real_ones["Cones"]["pair"]["as it is"]["default"]
    if "TUM fr1/desk" in real_ones:
        ends["TUM fr1/desk"] = real_ones["TUM fr1/desk"]["carried along"][LAST]
    return covers | {name: (score["cover_68"], score["cover_95"]) for name, score in ends.items()}


def print_merits(merits: dict[str, Any]) -> None:
    """The tables of the experiment."""
    shown, found = merits["rendered"], merits["real"]
    print("rendered, last frame       median error   stated    68 %    95 %  (over the sequence)   criterion")
    plane = shown["plane"]
    for name, scores, criterion in (
        ("plane", plane["noise 0, default"], "< .5 %"),
        ("plane, noise 2", plane["noise 2, default"], "< 2 %"),
        ("table-top", shown["table-top"]["default"], "60-76, 91-98"),
        ("sea bed", shown["sea bed"]["default"], "60-76, 91-98"),
        ("plane, thesis", plane["noise 0, thesis"], ""),
        ("table-top, thesis", shown["table-top"]["thesis"], ""),
        ("sea bed, thesis", shown["sea bed"]["thesis"], ""),
        ("sea bed, unequalised", shown["sea bed"]["thesis-unequalised"], "fails (2.10)"),
    ):
        end = scores[LAST]
        print(
            f"{name:<26}{100 * end['median_error']:>10.2f} % {100 * end['stated']:>8.2f} %"
            f"{mean(s['cover_68'] for s in scores):>8.1f}{mean(s['cover_95'] for s in scores):>8.1f}"
            f"{'':>23}{criterion}"
        )
    print("horizontal edges, mean error in % of depth, pair by pair")
    for name in ("right then up, horizontal edges", "right only, horizontal edges"):
        print(f"  {name:<34}" + " ".join(f"{100 * s['mean_error']:6.2f}" for s in shown["turn"][name]))
    print("light, bad-2.0 in %")
    for scene, table in {
        "rendered": shown["light"],
        **{k: v["light"] for k, v in found.items() if "light" in v},
    }.items():
        for name, values in table.items():
            print(
                f"  {scene:<10}{name:<22}"
                + "  ".join(f"{light} {value:.1f}" for light, value in values.items())
            )
    for name in ("Tsukuba", "Cones"):
        if name not in found:
            continue
        for case, table in found[name]["pair"].items():
            for who, score in table.items():
                print(
                    f"{name}, {case}: {who:<18} bad-1 {score['bad_1']:.2f}  bad-2 {score['bad_2']:.2f}"
                    f"  density {score['density']:.1f}"
                )
        for case, scores in found[name].get("five views", {}).items():
            print(f"{name}, {case}: bad-1 " + " ".join(f"{s['bad_1']:.2f}" for s in scores), end="")
            print("  stated px " + " ".join(f"{s['stated_px']:.3f}" for s in scores))
    if "TUM fr1/desk" in found:
        for case, scores in found["TUM fr1/desk"].items():
            print(
                f"TUM, {case}: " + " ".join(f"{s['median_error']:.3f}" for s in scores) + "  (needed < .103)"
            )
