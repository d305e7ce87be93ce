"""Chapter 6.4 of the thesis: the servo design, and the same loops on the emulated head through the drivers.

Writes figures 6.5–6.7, tables 6.1–6.3, the steps, velocities and profiles of every joint beside their prediction,
the searched filter bytes against the thesis's, identification and saccades, and a JSON of figures of merit.
"""

import argparse
import json
import math
import sys
import time
from pathlib import Path
from typing import Any

import numpy as np

from medusa.servo.design import ServoDesign, design_servo
from medusa.servo.figures import figure_6_5, figure_6_6, figure_6_7, save_figure
from medusa.servo.limits import AxisScale
from medusa.servo.loop import simulate_linear
from medusa.servo.margins import margins
from medusa.servo.position_filter import FilterRegisters, dead_band
from medusa.servo.response import step_figures
from medusa.servo.sampling import sample_period
from medusa.servo.thesis import AXES, DESIGN_SPEED_DEG, INTEGRAL_ACCELERATION, JOINTS, PERIOD
from sim_devices.clock import run_virtual
from tools.servo import figures
from tools.servo.measure import (
    INTEGRAL_DEG_S,
    MILLISECOND_TIMER,
    PROPORTIONAL_DEG_S,
    ROUGH,
    machine_merits,
    run_filters,
    run_machine,
    run_thirty_degrees,
    searched_registers,
    step_merits,
)
from tools.servo.runs import STEPS, Run

TIMER = 255


def main(argv: list[str]) -> int:
    parser = argparse.ArgumentParser(
        prog="tools/reproduce servo", description=(__doc__ or "").partition("\n")[0]
    )
    parser.add_argument("--out", type=Path, default=Path("out/servo"), help="default: out/servo")
    parser.add_argument(
        "--design-only", action="store_true", help="no emulated head: seconds instead of a minute"
    )
    arguments = parser.parse_args(argv)
    try:
        reproduce(arguments.out, design_only=arguments.design_only)
    except OSError as error:
        print(f"tools/reproduce servo: {error.filename}: {error.strerror}", file=sys.stderr)
        return 1
    return 0


def reproduce(out: Path, *, design_only: bool = False) -> None:
    """Everything into `out`; OSError when it cannot be written."""
    began = time.perf_counter()
    designs = {
        name: design_servo(joint.constants.plant, joint.counts_per_radian, TIMER, name)
        for name, joint in JOINTS.items()
    }
    merits: dict[str, Any] = {
        "design": {name: design.as_dict() for name, design in designs.items()},
        "linear_step": {name: linear_step(name) for name in JOINTS},
        "table_6_1": table_6_1(),
        "table_6_2": table_6_2(designs),
        "table_6_3": table_6_3(),
    }
    draw_design(designs, out)
    if not design_only:
        merits["on_the_plant"] = on_the_plant(out)
    path = out / "figures_of_merit.json"
    path.write_text(json.dumps(merits, indent=1, default=float) + "\n", encoding="utf-8")
    print_tables(merits)
    print(f"{path} and figures beside it, {time.perf_counter() - began:.0f} s")


def draw_design(designs: dict[str, ServoDesign], out: Path) -> None:
    """Figures 6.5–6.7, of the vergence as in the thesis."""
    vergence = designs["vergence"]
    save_figure(figure_6_5(vergence), out / "figure_6_5.png")
    save_figure(figure_6_6(vergence), out / "figure_6_6.png")
    save_figure(figure_6_7(vergence, JOINTS["vergence"].printed_filter), out / "figure_6_7.png")


def linear_step(name: str) -> dict[str, Any]:
    """Figure 6.7's figures for one joint with the printed gain."""
    joint = JOINTS[name]
    response = simulate_linear(
        joint.plant, joint.printed_pole, 0.0, joint.printed_filter.gain, PERIOD, np.ones(60)
    )
    found = step_figures(np.arange(60, dtype=np.float64) * PERIOD, response, 1.0)
    return {
        "overshoot": found.overshoot,
        "rise_ms": 1e3 * found.rise,
        "settling_2_percent_ms": 1e3 * found.settling,
        "first_samples": [round(float(y), 4) for y in response[1:7]],
    }


def table_6_1() -> dict[str, dict[str, float]]:
    """Resolution and speeds; the thesis's least speeds are those of a period of 2.0 ms."""
    rows = {}
    for name, joint in JOINTS.items():
        scale = AxisScale(joint.counts_per_radian, TIMER, joint.plant, name)
        rows[name] = {
            "resolution_deg": joint.resolution_deg,
            "least_speed_deg_s": math.degrees(scale.least_speed),
            "printed_least_speed_deg_s": joint.printed_least_speed_deg,
            "chip_speed_deg_s": math.degrees(scale.chip_speed),
            "amplifier_speed_deg_s": math.degrees(scale.amplifier_speed),
            "specified_speed_deg_s": DESIGN_SPEED_DEG,
        }
    return rows


def table_6_2(designs: dict[str, ServoDesign]) -> dict[str, dict[str, Any]]:
    """The three bounds of the proportional velocity gain, ours and printed."""
    rows = {}
    for name, design in designs.items():
        bounds = design.velocity
        rows[name] = {
            "i_stable_max": bounds.stability,
            "ii_accurate_min": bounds.accuracy,
            "iii_no_overshoot_max": bounds.no_overshoot,
            "printed": JOINTS[name].printed_velocity_gains,
            "statement": bounds.statement(),
        }
    return rows


def table_6_3() -> dict[str, dict[str, Any]]:
    """Speeds and accelerations of the profiles: registers, and the longest sample period that holds the speed."""
    rows = {}
    for name, joint in JOINTS.items():
        scale = AxisScale(joint.counts_per_radian, TIMER, joint.plant, name)
        timer = scale.timer_for_speed(joint.profile_speed)
        rows[name] = {
            "speed_deg_s": math.degrees(joint.profile_speed),
            "counts_per_sample": scale.counts_per_sample(joint.profile_speed),
            "longest_period_ms": None if timer is None else 1e3 * sample_period(timer),
            "amplifier_reaches_it": joint.profile_speed <= scale.amplifier_speed,
            "acceleration_deg_s2": math.degrees(joint.profile_acceleration),
            "acceleration_register": scale.acceleration_register(joint.profile_acceleration),
            "integral_velocity_register": scale.acceleration_register(INTEGRAL_ACCELERATION),
        }
    return rows


def on_the_plant(out: Path) -> dict[str, Any]:
    """Every run on the emulated head, frictionless and rough, with its figure."""
    smooth = run_virtual(run_machine())
    rough = run_virtual(run_machine(**ROUGH))
    registers, quick = searched_registers(TIMER), searched_registers(MILLISECOND_TIMER)
    searched = run_virtual(run_filters(registers))
    save_figure(figures.figure_steps(smooth.steps, rough.steps), out / "plant_steps.png")
    save_figure(figures.figure_profiles(smooth.profile, rough.profile), out / "plant_profiles.png")
    fast = {name: runs[-1] for name, runs in smooth.proportional.items()}
    fast_rough = {name: runs[-1] for name, runs in rough.proportional.items()}
    rows = [
        (f"proportional, {PROPORTIONAL_DEG_S[-1]:g}°/s", fast, fast_rough),
        (f"integral, {INTEGRAL_DEG_S:g}°/s", smooth.integral, rough.integral),
    ]
    save_figure(figures.figure_velocities(rows), out / "plant_velocities.png")
    shown = ("left_vergence", "tilt", "pan")
    save_figure(
        figures.figure_search({n: smooth.steps[n] for n in shown}, {n: searched[n] for n in shown}),
        out / "plant_search.png",
    )
    if smooth.saccade is not None:
        save_figure(figures.figure_saccade(smooth.saccade), out / "saccade.png")
    return {
        "frictionless": machine_merits(smooth),
        "friction_2_dac_backlash_0.02_deg": machine_merits(rough),
        "searched": _searched(registers, searched),
        "searched_with_friction_and_backlash": _searched(
            registers, run_virtual(run_filters(registers, **ROUGH))
        ),
        "searched_at_1_ms": _searched(quick, run_virtual(run_filters(quick))),
        "thirty_degrees": run_virtual(run_thirty_degrees()),
        "thirty_degrees_with_friction_and_backlash": run_virtual(run_thirty_degrees(**ROUGH)),
    }


def _searched(registers: dict[str, FilterRegisters], runs: dict[str, list[Run]]) -> dict[str, Any]:
    """Bytes, margins, dead band and the steps on the plant, by axis."""
    rows = {}
    for name, r in registers.items():
        found = margins(AXES[name].plant.at_timer(r.timer), r.filter)
        rows[name] = {
            "bytes": {"A": r.zero, "B": r.pole, "K": r.gain, "T": r.timer},
            "gain_margin": found.gain,
            "phase_margin_deg": found.phase_deg,
            "dead_band_counts": dead_band(r.filter),
            "steps": {str(s): step_merits(run) for s, run in zip(STEPS, runs[name], strict=True)},
        }
    return rows


def print_tables(merits: dict[str, Any]) -> None:
    """The tables and the runs in short, for people."""
    for name, row in merits["table_6_2"].items():
        printed = ", ".join(f"{v:g}" for v in row["printed"])
        values = [row[k] for k in ("i_stable_max", "ii_accurate_min", "iii_no_overshoot_max")]
        print(f"table 6.2 {name:9s} " + "  ".join(f"{v:6.2f}" for v in values) + f"   (printed {printed})")
    for name, row in merits["linear_step"].items():
        print(
            f"step {name:9s} overshoot {row['overshoot']:.5f}, 10–90 % {row['rise_ms']:.2f} ms, "
            f"2 % {row['settling_2_percent_ms']:.2f} ms"
        )
    if "on_the_plant" not in merits:
        return
    plant = merits["on_the_plant"]
    for axis in AXES:
        ours, theirs = plant["searched"][axis]["steps"], plant["frictionless"][axis]["steps"]
        quick = plant["searched_at_1_ms"][axis]["steps"]
        for step in map(str, STEPS):
            print(
                f"{axis:15s} {step:>6s} counts: 2 % after {_ms(theirs[step])} ms with the thesis's bytes, "
                f"{_ms(ours[step])} ms with the searched ones, {_ms(quick[step])} ms at 1 ms"
            )
    for name, row in plant["thirty_degrees"].items():
        print(f"30° {name}: {row['milliseconds']:.1f} ms, {row['final_error_counts']} counts off")


def _ms(merits: dict[str, Any]) -> str:
    return "–" if merits["settling_ms"] is None else f"{merits['settling_ms']:.1f}"
