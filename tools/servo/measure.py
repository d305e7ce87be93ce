"""All runs of the servo experiment, by machine: what was recorded, and its figures of merit."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from medusa.mc3000.board import Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.plant_measurement import measure_plant
from medusa.servo.position_filter import FilterRegisters, dead_band, velocity_constant
from medusa.servo.search import search_filter
from medusa.servo.thesis import AXES, JOINTS
from medusa.servo.trials import thesis_registers
from tools.servo.runs import STEPS, Bench, Run, homed_head, mean_speed_ratio
from tools.servo.saccades import SaccadeRun, four_joint_targets, run_saccade

PROFILE_DEG = 30.0
PROPORTIONAL_DEG_S = (10.0, 60.0)
INTEGRAL_DEG_S = 30.0
ROUGH = {"friction": 2.0, "backlash_deg": 0.02}
MILLISECOND_TIMER = 124


@dataclass
class Machine:
    """The runs on one emulated head, by axis."""

    friction: float
    backlash_deg: float
    steps: dict[str, list[Run]] = field(default_factory=dict)
    proportional: dict[str, list[Run]] = field(default_factory=dict)
    integral: dict[str, Run] = field(default_factory=dict)
    profile: dict[str, Run] = field(default_factory=dict)
    identified: dict[str, dict[str, float]] = field(default_factory=dict)
    saccade: SaccadeRun | None = None


async def run_machine(*, friction: float = 0.0, backlash_deg: float = 0.0) -> Machine:
    """Steps, velocities, profiles, identification and a saccade of all joints on one emulated head."""
    machine = Machine(friction, backlash_deg)
    async with homed_head(friction=friction, backlash_deg=backlash_deg) as (sim, head):
        for name in AXES:
            bench = Bench(sim, head, name)
            machine.steps[name] = []
            # The smooth steps stand beside the equations page's, and start as they do.
            place = bench.place if friction or backlash_deg else bench.place_on_edge
            for step in STEPS:
                await place(-18.0 if step == STEPS[-1] else 0.0)
                machine.steps[name].append(await bench.step(step if bench.scale > 0 else -step))
            await bench.place(-PROFILE_DEG / 2)
            machine.profile[name] = await bench.profile(PROFILE_DEG)
            await bench.place(-18.0)
            machine.integral[name] = await bench.integral_velocity(INTEGRAL_DEG_S)
            machine.proportional[name] = []
            for speed in PROPORTIONAL_DEG_S:
                await bench.place(-15.0)
                machine.proportional[name].append(await bench.proportional_velocity(speed))
            await bench.place(0.0)
        machine.saccade = await run_saccade(sim, head, four_joint_targets())
        for name in AXES:
            await head.move({name: 0.0})
            machine.identified[name] = _identification(name, await measure_plant(head, name))
            await Mc3000Drive.of(head).axes[name].set_mode(Mode.POSITION)
    return machine


def _identification(name: str, found: Any) -> dict[str, float]:
    truth = AXES[name].plant
    return {
        "time_constant_ms": 1e3 * found.plant.time_constant,
        "time_constant_stated_percent": 100 * found.time_constant_error / found.plant.time_constant,
        "time_constant_error_percent": 100 * (found.plant.time_constant / truth.time_constant - 1),
        "velocity_gain": found.plant.velocity_gain,
        "velocity_gain_stated_percent": 100 * found.velocity_gain_error / found.plant.velocity_gain,
        "velocity_gain_error_percent": 100 * (found.plant.velocity_gain / truth.velocity_gain - 1),
        "friction_dac": found.friction_dac,
        "asymmetry_percent": 100 * found.asymmetry,
        "residual_counts": found.residual_counts,
    }


async def run_filters(
    filters: dict[str, FilterRegisters], *, friction: float = 0.0, backlash_deg: float = 0.0
) -> dict[str, list[Run]]:
    """Steps of every axis with given position filters."""
    runs: dict[str, list[Run]] = {}
    async with homed_head(friction=friction, backlash_deg=backlash_deg, filters=filters) as (sim, head):
        for name in AXES:
            bench = Bench(sim, head, name)
            runs[name] = []
            # The smooth steps stand beside the equations page's, and start as they do.
            place = bench.place if friction or backlash_deg else bench.place_on_edge
            for step in STEPS:
                await place(-18.0 if step == STEPS[-1] else 0.0)
                runs[name].append(await bench.step(step if bench.scale > 0 else -step))
    return runs


def searched_registers(timer: int = 255) -> dict[str, FilterRegisters]:
    """The searched bytes of every axis; both eyes share theirs."""
    kinds = {name: search_filter(joint.plant, timer).registers for name, joint in JOINTS.items()}
    return {axis: kinds[joint.name] for axis, joint in AXES.items()}


def millisecond_registers() -> dict[str, FilterRegisters]:
    """The thesis's design at a sample period of 1 ms, where the chip holds the speeds of table 6.3."""
    return {axis: thesis_registers(joint.plant, MILLISECOND_TIMER) for axis, joint in AXES.items()}


async def run_thirty_degrees(
    *, friction: float = 0.0, backlash_deg: float = 0.0
) -> dict[str, dict[str, float]]:
    """A 30° saccade of pan, tilt and one eye alone at 2.048 ms, and of the tilt at 1 ms with table 6.3."""
    found: dict[str, dict[str, float]] = {}
    async with homed_head(friction=friction, backlash_deg=backlash_deg) as (sim, head):
        for name in ("left_vergence", "tilt", "pan"):
            await run_saccade(sim, head, {name: math.radians(-15)})
            run = await run_saccade(sim, head, {name: math.radians(15)})
            found[f"{name} at 2.048 ms"] = _saccade_figures(run)
    limits = {"max_speed_deg_s": math.degrees(AXES["tilt"].profile_speed)}
    async with homed_head(
        friction=friction,
        backlash_deg=backlash_deg,
        filters=millisecond_registers(),
        limits={"tilt": limits},
    ) as (sim, head):
        await run_saccade(sim, head, {"tilt": math.radians(-15)})
        run = await run_saccade(sim, head, {"tilt": math.radians(15)})
        found["tilt at 1.000 ms"] = _saccade_figures(run)
    return found


def _saccade_figures(run: SaccadeRun) -> dict[str, float]:
    return {
        "milliseconds": 1e3 * (run.end - run.start),
        "final_error_counts": max(abs(e) for e in run.error_counts.values()),
        "true_error_deg": max(abs(e) for e in run.error_deg.values()),
    }


def step_merits(run: Run) -> dict[str, float | None]:
    """Figures of a step: ms and counts; None where the shaft never settled."""
    figures = run.step()
    return {
        "rise_ms": 1e3 * figures.rise,
        "overshoot_counts": run.overshoot_counts,
        "settling_ms": None if math.isnan(figures.settling) else 1e3 * figures.settling,
        "final_error_counts": run.final_error_counts,
        "prediction_error_counts": run.prediction_error,
    }


def machine_merits(machine: Machine) -> dict[str, Any]:
    """Figures of merit of all runs on one head, by axis."""
    merits: dict[str, Any] = {}
    for name, joint in AXES.items():
        registers = thesis_registers(joint.plant, 255).filter
        constant = velocity_constant(joint.plant.velocity_gain, registers)
        profile, integral = machine.profile[name], machine.integral[name]
        cruise = integral.time >= 0.4
        speed = np.ptp(integral.command[cruise]) / np.ptp(integral.time[cruise])
        merits[name] = {
            "steps": {
                f"{step}": step_merits(run) for step, run in zip(STEPS, machine.steps[name], strict=True)
            },
            "dead_band_counts": dead_band(registers, machine.friction),
            "profile": {
                "largest_following_error_deg": float(
                    np.abs(profile.command - profile.counts).max() / joint.counts_per_degree
                ),
                "largest_dac": float(np.abs(profile.dac).max()),
                "overshoot_counts": profile.overshoot_counts,
                "final_error_counts": profile.final_error_counts,
                "prediction_error_counts": profile.prediction_error,
            },
            "integral_velocity": {
                "mean_speed_ratio": mean_speed_ratio(integral, 0.2),
                "lag_counts": float(np.abs(integral.error[cruise]).mean()),
                "lag_by_velocity_constant": float(speed / constant),
                "prediction_error_counts": integral.prediction_error,
            },
            "proportional_velocity": {
                f"{degrees:g} deg/s": {
                    "ratio": mean_speed_ratio(run, 0.2),
                    "prediction_error_counts": run.prediction_error,
                }
                for degrees, run in zip(PROPORTIONAL_DEG_S, machine.proportional[name], strict=True)
            },
            "identification": machine.identified[name],
        }
    if machine.saccade is not None:
        merits["saccade"] = {
            "milliseconds": 1e3 * (machine.saccade.end - machine.saccade.start),
            "end_spread_ms": 1e3 * machine.saccade.end_spread,
            "ends_ms": {n: 1e3 * (t - machine.saccade.start) for n, t in machine.saccade.ends.items()},
            "settled": machine.saccade.settled,
            "error_counts": machine.saccade.error_counts,
            "true_error_deg": machine.saccade.error_deg,
        }
    return merits
