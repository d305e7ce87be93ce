"""Gaze, thesis 6.5 and 6.6: table 6.4, figures 6.13 and 6.14, coordination, vergence, saccades, and prediction.

Through cameras, drivers, ptys and emulated boards, in virtual time. Writes figures and gaze.json.
"""

import argparse
import json
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

from medusa.gaze.pid import TABLE_6_4
from sim_devices.clock import run_virtual
from tools.gaze import figures
from tools.gaze.eye_head import coordination, saccades, vergence
from tools.gaze.screen import watch_screen
from tools.gaze.single_axis import figure_6_14, table_6_4
from tools.gaze.sweep import all_cases, sweep

PICTURES = Path("../shared/data/visp_mire2_target")
PARTS = ("table", "figure", "coordination", "vergence", "saccades", "screen", "sweep")


def table(out: Path, quick: bool) -> dict[str, Any]:
    """Table 6.4 on ramps at 1 ms; the orderings of equations.md §1.9."""
    speeds = (2.0, 5.0) if quick else (1.0, 2.0, 5.0)
    found = run_virtual(table_6_4(speeds))
    figures.draw_table_6_4(found["tracks"], speeds[1], out / "table_6_4.png")
    checks = {}
    for speed, rms in found["rms_deg"].items():
        checks[f"{speed} deg/s: i > ii > iii"] = rms["i"] > rms["ii"] > rms["iii"]
        checks[f"{speed} deg/s: i/ii in 1.35..1.65"] = 1.35 <= rms["i"] / rms["ii"] <= 1.65
        checks[f"{speed} deg/s: iv, v < 0.5 ii"] = max(rms["iv"], rms["v"]) < 0.5 * rms["ii"]
        checks[f"{speed} deg/s: |vi - ii| < 15 %"] = abs(rms["vi"] / rms["ii"] - 1.0) < 0.15
    return {"rms_deg": found["rms_deg"], "checks": checks}


def figure(out: Path, quick: bool) -> dict[str, Any]:
    """Figure 6.14 on slow sine and triangle."""
    found = run_virtual(figure_6_14(60.0))
    figures.draw_figure_6_14(found["tracks"], out / "figure_6_14.png")
    checks = {}
    for wave, rms in found["rms_deg"].items():
        slow, fast, micro = rms.values()
        checks[f"{wave}: 2.048 ms <= 0.8 of 1 ms"] = fast <= 0.8 * slow
        checks[f"{wave}: microsaccades <= 0.9 of that"] = micro <= 0.9 * fast
    return {"rms_deg": found["rms_deg"], "checks": checks}


def coordination_part(out: Path, quick: bool) -> dict[str, Any]:
    """The three ways of 6.5.3 on one path."""
    found = run_virtual(coordination(20.0 if quick else 40.0))
    figures.draw_coordination(found["runs"], found["figures"], out / "coordination.png")
    return {"figures": found["figures"], "checks": {n: not f["lost"] for n, f in found["figures"].items()}}


def vergence_part(out: Path, quick: bool) -> dict[str, Any]:
    """Vergence over 0.3 to 3 m."""
    found = run_virtual(vergence(20.0 if quick else 40.0))
    figures.draw_vergence(found["run"], out / "vergence.png")
    median = found["figures"]["vergence_median_deg"]
    return {"figures": found["figures"], "checks": {"median vergence error < 0.2 deg": median < 0.2}}


def saccades_part(out: Path, quick: bool) -> dict[str, Any]:
    """Where saccades land."""
    found = run_virtual(saccades())
    checks = {
        "first < 0.5 deg": found["full kinematics"]["first_deg"] < 0.5,
        "next < 0.1 deg": found["full kinematics"]["next_deg"] < 0.1,
        "centres 20 mm off < 1 deg": found["centres 20 mm off, unknown"]["first_deg"] < 1.0,
    }
    return {"landings": found, "checks": checks}


def screen_part(out: Path, quick: bool) -> dict[str, Any]:
    """Real pictures on a swinging screen, followed and held still."""
    if not PICTURES.is_dir():
        return {"skipped": f"{PICTURES} is not here"}
    found = run_virtual(watch_screen(PICTURES))
    held = run_virtual(watch_screen(PICTURES, still=True))
    figures.draw_screen(found["run"], found["in_fovea"], out / "screen.png")
    checks = {"followed >= 95 %": found["in_fovea"] >= 0.95, "a still head fails": held["in_fovea"] < 0.95}
    return {"in_fovea": found["in_fovea"], "in_fovea_still": held["in_fovea"], "checks": checks}


def sweep_part(out: Path, quick: bool) -> dict[str, Any]:
    """PID against prediction over waves, rates and speeds."""
    cases = all_cases()
    controllers: tuple[str, ...] = ("predictive", *TABLE_6_4)
    if quick:
        cases = [case for case in cases if case.speed_deg_s in (5.0, 20.0, 40.0) or case.amplitude_deg < 25.0]
        controllers = ("predictive", "i", "ii", "iv")
    rows = run_virtual(sweep(cases, controllers))
    figures.draw_sweep(rows, list(controllers), out / "sweep.png")
    first = rows[0]
    compared = [row for row in rows if row["compared"] and row["best_pid_rms_deg"] is not None]
    checks = {
        "15 deg, 0.2 Hz sine at 6 Hz: at most 1/3 of the best PID": (
            first["predictive"]["rms_deg"] <= first["best_pid_rms_deg"] / 3.0
        ),
        "no worse anywhere compared": all(
            r["predictive"]["rms_deg"] <= r["best_pid_rms_deg"] for r in compared
        ),
        "none lost up to 40 deg/s at 25 Hz": not any(
            r["predictive"]["lost"] for r in rows if r["rate_hz"] == 25.0 and r["speed_deg_s"] <= 40.0
        ),
    }
    return {"rows": rows, "checks": checks}


RUN: dict[str, Callable[[Path, bool], dict[str, Any]]] = {
    "table": table,
    "figure": figure,
    "coordination": coordination_part,
    "vergence": vergence_part,
    "saccades": saccades_part,
    "screen": screen_part,
    "sweep": sweep_part,
}


def main(argv: list[str]) -> int:
    """Run the parts; the exit code is 1 when a check fails."""
    parser = argparse.ArgumentParser(prog="tools/reproduce gaze", description=__doc__)
    parser.add_argument("--out", type=Path, default=Path("out/gaze"))
    parser.add_argument("--only", nargs="+", choices=PARTS, default=PARTS, help="parts to run")
    parser.add_argument("--quick", action="store_true", help="fewer speeds and controllers")
    options = parser.parse_args(argv)
    options.out.mkdir(parents=True, exist_ok=True)
    document: dict[str, Any] = {}
    for name in options.only:
        begin = time.perf_counter()
        document[name] = RUN[name](options.out, options.quick)
        print(f"{name} ({time.perf_counter() - begin:.0f} s)")
        for check, passed in document[name].get("checks", {}).items():
            print(f"  {'ok  ' if passed else 'FAIL'} {check}")
        if "skipped" in document[name]:
            print(f"  skipped: {document[name]['skipped']}")
    (options.out / "gaze.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
    print(f"left behind: {options.out / 'gaze.json'} and figures")
    return int(any(not passed for part in document.values() for passed in part.get("checks", {}).values()))


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
