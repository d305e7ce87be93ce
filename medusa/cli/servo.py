"""Commands of the servo loops: design, identify, tune, and the saccade they are for."""

import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.motion import AXES, error_counts
from medusa.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.head.joint_group import JointGroup
    from medusa.head.moves import MoveReport
    from medusa.mc3000.tuning import Tuning
    from medusa.servo.identification import Identification
    from medusa.servo.position_filter import FilterRegisters

BYTES_HELP = "Bytes A,B,K,T to judge in place of the searched ones, as 206,80,9,255."
EXCURSION_HELP = "Degrees that a pulse may go."


def register(app: typer.Typer) -> None:
    for command in (identify, tune, saccade):
        app.command()(command)


def read_bytes(options: Options, text: str) -> "FilterRegisters | None":
    """A,B,K,T as typed; None when nothing was."""
    from medusa.errors import CommandError
    from medusa.servo.position_filter import FilterRegisters

    if not text:
        return None
    try:
        zero, pole, gain, timer = (int(word) for word in text.split(","))
    except ValueError:
        options.fail(f"{text!r} is not four bytes A,B,K,T", 2)
    try:
        return FilterRegisters(zero, pole, gain, timer)
    except CommandError as error:
        options.fail(str(error), 2)


def _identified(name: str, found: "Identification") -> dict[str, Any]:
    return {
        "axis": name,
        "time_constant_ms": 1e3 * found.plant.time_constant,
        "time_constant_error_ms": 1e3 * found.time_constant_error,
        "velocity_gain_counts_s": found.plant.velocity_gain,
        "velocity_gain_error": found.velocity_gain_error,
        "friction_dac": found.friction_dac,
        "asymmetry_percent": 100 * found.asymmetry,
        "residual_counts": found.residual_counts,
        "samples": found.samples,
    }


def identify(
    context: typer.Context,
    axis: str = typer.Argument(..., help=f"One of {AXES}."),
    excursion: float = typer.Option(8.0, help=EXCURSION_HELP),
    largest: int = typer.Option(40, help="Greatest motor command of a pulse, DAC counts."),
    repeats: int = typer.Option(2, help="Rounds of pulses."),
    save: Annotated[Path | None, typer.Option(help="Write the result to this JSON file, too.")] = None,
) -> None:
    """Measure a joint's time constant, velocity gain and friction by short open-loop pulses.

    The joint has to be homed, and two excursions clear of both soft limits. Errors are two standard
    deviations.
    """
    options: Options = context.obj

    async def body() -> None:
        from medusa.files.replace_file import replace_file
        from medusa.mc3000.plant_measurement import Excitation, measure_plant

        excitation = Excitation(math.radians(excursion), largest_dac=largest, repeats=repeats)
        async with options.head(homed=True, joints=[axis]) as (head, _):
            row = _identified(axis, await measure_plant(head, axis, excitation))
        if save is not None:
            replace_file(save, json.dumps(row, indent=1) + "\n")
        options.show(row, lambda: _print_identified(row))

    options.run(body)


def _print_identified(row: dict[str, Any]) -> None:
    print(
        f"{row['axis']}: T_M = {row['time_constant_ms']:.3f} ± {row['time_constant_error_ms']:.3f} ms, "
        f"C = {row['velocity_gain_counts_s']:.2f} ± {row['velocity_gain_error']:.2f} counts/s per DAC count\n"
        f"  friction {row['friction_dac']:.2f} DAC counts, asymmetry of the directions "
        f"{row['asymmetry_percent']:+.2f} %, residual {row['residual_counts']:.2f} counts rms"
        f" over {row['samples']} samples"
    )


def tune(
    context: typer.Context,
    axes: Annotated[list[str], typer.Argument(metavar="AXIS...", help=f"Of {AXES}.")],
    timer: int = typer.Option(
        None, min=15, max=255, help="Sample timer T; one for all joints of a board.  [default: as configured]"
    ),
    bytes_: str = typer.Option("", "--bytes", metavar="A,B,K,T", help=BYTES_HELP),
    write: bool = typer.Option(False, "--write", help="Write the bytes to the board and the configuration."),
    excursion: float = typer.Option(8.0, help=EXCURSION_HELP),
) -> None:
    """Identify joints and turn their plants into filter bytes, beside those of the thesis's method.

    With --write the bytes go to the board and into the configuration file, which changes whole or not at all; the
    joint has to be checked and homed again then.
    """
    options: Options = context.obj
    registers = read_bytes(options, bytes_)

    async def body() -> None:
        from medusa.config.file import write_keys
        from medusa.mc3000.drive import Mc3000Drive
        from medusa.mc3000.plant_measurement import Excitation
        from medusa.mc3000.tuning import tune_axes, write_filter

        file: str | None = None
        async with options.head(homed=True, joints=axes) as (head, _):
            bounds = Excitation(math.radians(excursion))
            tunings = await tune_axes(head, axes, timer=timer, registers=registers, excitation=bounds)
            if write:
                # The file first: it is what a board is loaded from, and its limits may refuse the bytes.
                file = Mc3000Drive.of(head).config.file
                if file is not None:
                    write_keys(file, {key: value for t in tunings for key, value in t.keys.items()})
                for tuning in tunings:
                    await write_filter(head, tuning)
        document = {"tuned": [_tuned(t) for t in tunings], "written_to_board": write, "written_to_file": file}
        options.show(document, lambda: _print_tuned(tunings, write, file))

    options.run(body)


def _tuned(tuning: "Tuning") -> dict[str, Any]:
    return {
        "axis": tuning.axis,
        "identified": _identified(tuning.axis, tuning.identified),
        "bytes": _row("chosen", tuning.chosen),
        "thesis_bytes": _row("thesis", tuning.thesis),
        "proportional_velocity_K": tuning.velocity_register,
    }


def _row(name: str, candidate: Any) -> dict[str, Any]:
    r = candidate.registers
    finite = {s: None if math.isinf(v) else round(1e3 * v, 1) for s, v in candidate.settling.items()}
    return {
        "filter": name,
        "A": r.zero,
        "B": r.pole,
        "K": r.gain,
        "T": r.timer,
        **{f"settling_{step}_ms": finite[step] for step in (100, 1000, 10_000)},
        "overshoot_100": candidate.overshoot[100],
        "dead_band_counts": round(candidate.dead_band, 2),
    }


def _print_tuned(tunings: "list[Tuning]", written: bool, file: str | None) -> None:
    for tuning in tunings:
        _print_identified(_identified(tuning.axis, tuning.identified))
        rows = [_row("chosen", tuning.chosen), _row("thesis", tuning.thesis)]
        short = [
            {k.removeprefix("settling_").removesuffix("_ms"): str(v) for k, v in row.items()} for row in rows
        ]
        print_table(f"{tuning.axis}: 2 % settling in ms of steps of 100, 1000, 10000 counts", short)
    if written:
        where = file if file is not None else "no file: this head has no configuration file"
        print(f"written to the board and to {where}; check and home the joint again")


def saccade(
    context: typer.Context,
    pan: float = typer.Option(None, help="Degrees, positive left."),
    tilt: float = typer.Option(None, help="Degrees, positive down."),
    version: float = typer.Option(None, help="Mean of both eyes, degrees, positive left."),
    vergence: float = typer.Option(None, help="Right eye less left eye, degrees, 0 or more."),
) -> None:
    """Jump with all named joints so that they arrive together, and wait until they have settled."""
    options: Options = context.obj
    asked = {"pan": pan, "tilt": tilt, "version": version, "vergence": vergence}
    if all(angle is None for angle in asked.values()):
        options.fail("nowhere to look: give --pan, --tilt, --version or --vergence", 2)
    moved = [name for name in ("pan", "tilt") if asked[name] is not None]
    if version is not None or vergence is not None:
        moved += ["left_vergence", "right_vergence"]

    async def body() -> None:
        from medusa.errors import DeviceFault
        from medusa.head.saccade import saccade_targets

        async with options.head(homed=True, joints=moved) as (head, _):
            now = {name: joint.commanded for name, joint in (await head.read()).joints.items()}
            given = {n: math.radians(angle) for n, angle in asked.items() if angle is not None}
            report = await head.move(saccade_targets(now, **given), together=True)
        rows = _saccade_rows(head, report)
        if not report.all_settled:
            away = [n for n, ok in report.settled.items() if not ok]
            errors = ", ".join(f"{n} ({math.degrees(report.errors[n]):+.3f}°)" for n in away)
            raise DeviceFault(f"{errors}: arrived but not settled")
        skew = None if math.isnan(report.end_skew) else round(1e3 * report.end_skew, 3)
        document = {"saccade": rows, "seconds": report.plan.duration, "end_skew_ms": skew}
        options.show(document, lambda: _print_saccade(rows, report))

    options.run(body)


def _saccade_rows(head: "JointGroup", report: "MoveReport") -> list[dict[str, Any]]:
    plan, errors = report.plan, error_counts(head, report)
    return [
        {
            "axis": name,
            "target_deg": round(math.degrees(plan.targets[name]), 4),
            "angle_deg": round(math.degrees(report.reading.joints[name].angle), 4),
            **errors[name],
            "profile_ms": round(1e3 * plan.seconds[name], 3),
            "peak_deg_s": round(math.degrees(plan.peak_speeds[name]), 1),
            "ends_early": name in plan.early,
        }
        for name in plan.targets
    ]


def _print_saccade(rows: list[dict[str, Any]], report: "MoveReport") -> None:
    print_table("saccade", rows)
    early = f"; too near to be stretched: {', '.join(report.plan.early)}" if report.plan.early else ""
    print(f"{1e3 * report.plan.duration:.1f} ms, ends {1e3 * report.end_skew:.2f} ms apart{early}")
