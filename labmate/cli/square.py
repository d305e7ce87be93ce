"""The square, both ways, and the calibration from it."""

from __future__ import annotations

import re
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from labmate.cli.options import Options
from labmate.cli.tables import print_table

if TYPE_CHECKING:
    from labmate.calibration import Calibration, Direction
    from labmate.odometry import Pose, WheelGeometry
    from labmate.square import Progress, SquareResult, SquareRun

_OUT = "labmate-square"
_RECORD = f"{_OUT}/square.json"
_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


def register(app: typer.Typer) -> None:
    app.command()(square)
    app.command()(calibrate)


def square(
    context: typer.Context,
    side: float = typer.Option(4.0, min=0.1, max=20.0, metavar="M", help="Side of the square."),
    direction: str = typer.Option(
        "", metavar="ccw|cw", help="On the floor: one way at a time, measured in between."
    ),
    out: str = typer.Option(_OUT, metavar="DIR", help="Where record, picture and calibration go."),
) -> None:
    """Drive a square both ways, calibrate the odometry from its closing errors, and drive it again calibrated."""
    options: Options = context.obj
    if direction not in ("", "ccw", "cw"):
        options.fail(f"--direction is ccw or cw, not {direction}")
    if options.sim:
        if direction:
            options.fail("--sim drives both ways and sees where the base is: leave --direction out")
        _square_in_simulation(options, side, Path(out))
    elif not direction:
        options.fail(
            "on the floor one way at a time: --direction ccw, measure where it stands, then --direction cw"
        )
    else:
        _square_on_the_floor(options, side, "ccw" if direction == "ccw" else "cw", Path(out))


def calibrate(
    context: typer.Context,
    measured: list[str] = typer.Option(
        [],
        "--measured",
        metavar="WAY=X,Y",
        help="Where a run ended, from its start: ccw=226mm,-205mm. Once a run.",
    ),
    record: str = typer.Option(_RECORD, metavar="FILE", help="What `labmate-drive square` recorded."),
    deviation: str = typer.Option("2mm", metavar="LENGTH", help="How well the ends were measured."),
    out: str = typer.Option("labmate-calibration.toml", metavar="FILE", help="Where the calibration goes."),
) -> None:
    """Calibrate from recorded squares and where the operator measured their ends (x ahead, y left of the start).

    With --sim and nothing measured, the emulated base drives the squares and its true pose is the measurement.
    """
    options: Options = context.obj
    if options.sim and not measured:
        _square_in_simulation(options, 4.0, Path(_OUT), Path(out))
        return
    if not measured:
        options.fail(
            "nothing measured: --measured ccw=X,Y --measured cw=X,Y, each with its unit, for example 226mm"
        )

    async def body() -> tuple[Calibration, list[SquareRun], WheelGeometry]:
        from labmate.config import write_calibration
        from labmate.odometry import Pose
        from labmate.square import calibrate as calibrate_runs
        from labmate.square_report import read_record

        spread = _length(deviation)
        ends = [_measured(text, Pose) for text in measured]
        runs, nominal = read_record(Path(record))
        found = calibrate_runs(_paired(runs, ends), nominal, spread)
        note = f"UMBmark from {len(ends)} measured squares of {runs[0].side:g} m: " + " ".join(measured)
        write_calibration(Path(out), found, nominal.wheel_base, round(nominal.counts_per_metre), note)
        return found, runs, nominal

    found, _, _ = options.run(body)
    from labmate.square_report import calibration_in_words

    document = calibration_in_words(found) | {"written": out}
    options.show(
        document, lambda: print_table("calibration", [{"": k, "value": v} for k, v in document.items()])
    )


def _square_in_simulation(options: Options, side: float, out: Path, calibration: Path | None = None) -> None:
    async def body() -> tuple[SquareResult, WheelGeometry]:
        from labmate.square import run_experiment
        from labmate.square_report import require_writable

        for directory in (out, (calibration or out / "_").parent):
            require_writable(directory)
        async with options.base() as (base, simulated):
            if simulated is None:
                raise AssertionError("only --sim comes here")
            with _progress(options, 34) as progress:
                result = await run_experiment(base, side, simulated.true_pose, progress=progress)
            return result, simulated.true_geometry()

    result, true = options.run(body)

    async def write() -> dict[str, Any]:
        import json

        from labmate.config import write_calibration
        from labmate.replace_file import replace_file
        from labmate.square_report import (
            CALIBRATION_NAME,
            FIGURE_NAME,
            RECORD_NAME,
            draw,
            summary,
            write_record,
        )

        kept = calibration or out / CALIBRATION_NAME
        document = summary(result, true)
        write_record(out / RECORD_NAME, result.uncalibrated, result.nominal)
        draw(out / FIGURE_NAME, result)
        counts = round(result.nominal.counts_per_metre)
        note = f"UMBmark in the emulator, one square of {side:g} m each way"
        write_calibration(kept, result.calibration, result.nominal.wheel_base, counts, note)
        document["files"] = [str(out / RECORD_NAME), str(out / FIGURE_NAME), str(kept)]
        replace_file(out / "summary.json", json.dumps(document, indent=1) + "\n")
        return document

    document = options.run(write)
    options.show(document, lambda: _print_summary(document))


def _square_on_the_floor(options: Options, side: float, direction: Direction, out: Path) -> None:
    async def body() -> tuple[SquareRun, Pose]:
        from labmate.odometry import WheelGeometry
        from labmate.square import drive_square
        from labmate.square_report import RECORD_NAME, read_record, require_writable, write_record

        path = out / RECORD_NAME
        require_writable(out)
        earlier = read_record(path)[0] if path.exists() else []
        async with options.base() as (base, _):
            calibration = base.calibration
            with _progress(options, 8 if calibration is None else 9) as progress:
                run = await drive_square(base, direction, side, calibration=calibration, progress=progress)
            nominal = WheelGeometry(base.hello.wheel_base, 1.0, base.hello.counts_per_metre)
            geometry = base.readings.geometry
        if calibration is None:
            write_record(path, [*earlier, run], nominal)
        return run, run.path(geometry)[-1]

    run, end = options.run(body)
    from labmate.square_report import pose_in_words

    kept = "" if run.calibrated else f"; recorded in {out / 'square.json'}"
    document = {"direction": direction, "calibrated": run.calibrated, "odometry_end": pose_in_words(end)}
    options.show(
        document,
        lambda: print(
            f"{direction}: odometry ended at x {1e3 * end.x:.1f} mm, y {1e3 * end.y:.1f} mm{kept}\n"
            "measure where the base really ended (x ahead, y left of its start), for labmate-drive calibrate"
        ),
    )


def _print_summary(document: dict[str, Any]) -> None:
    rows = [
        {
            "square": run["direction"],
            "driven by": run["driven_by"],
            "s": run["seconds"],
            "true end x mm": round(1e3 * run["true_end"]["x_m"], 1),
            "y mm": round(1e3 * run["true_end"]["y_m"], 1),
            "heading °": round(run["true_end"]["heading_deg"], 2),
            "closing mm": round(run["closing_mm"]["distance"], 2),
        }
        for run in document["runs"]
    ]
    print_table("squares: where the base really ended, and how far the odometry was off", rows)
    found = document["calibration"]
    rows = [
        {
            "": name,
            "nominal": round(document["nominal"][key], 5),
            "estimated": found[key],
            "±": found[deviation],
            "true": document["true"][key],
        }
        for name, key, deviation in (
            ("wheel base, mm", "wheel_base_mm", "wheel_base_deviation_mm"),
            ("right/left diameter", "wheel_ratio", "wheel_ratio_deviation"),
        )
    ]
    print_table("calibration", rows)
    for file in document["files"]:
        print(file)


@contextmanager
def _progress(options: Options, legs: int) -> Iterator[Callable[[Progress], None]]:
    """A bar on a terminal, a line a leg elsewhere; on stderr."""
    from rich.console import Console
    from rich.progress import Progress as Bars

    done: set[tuple[str, bool, int]] = set()
    console = Console(stderr=True)
    with Bars(console=console, disable=not console.is_terminal) as bars:
        bar = bars.add_task("square", total=legs)

        def show(progress: Progress) -> None:
            leg = (progress.direction, progress.calibrated, progress.done)
            if leg in done:
                return
            done.add(leg)
            told = f"{progress.direction}{', calibrated' if progress.calibrated else ''}"
            p = progress.snapshot.odometry
            at = f"leg {progress.done} of {progress.of}, odometry at {p.x:.3f}, {p.y:.3f} m"
            if console.is_terminal:
                bars.update(bar, completed=len(done), description=f"{told}: {at}")
            else:
                options.say(f"{told}: {at}")

        yield show
        bars.update(bar, completed=legs)
    sys.stderr.flush()


def _measured(text: str, pose: type[Pose]) -> tuple[str, Pose]:
    from medusa.errors import CommandError

    found = re.fullmatch(r"(ccw|cw)=([^,]+),([^,]+)", text.replace(" ", ""))
    if found is None:
        raise CommandError(f"--measured {text}: it takes ccw=X,Y or cw=X,Y, for example ccw=226mm,-205mm")
    return found[1], pose(_length(found[2]), _length(found[3]), 0.0)


def _length(text: str) -> float:
    from medusa.errors import CommandError

    found = re.fullmatch(r"([-+]?(?:\d+\.?\d*|\.\d+))(mm|cm|m)", text.strip())
    if found is None:
        raise CommandError(f"{text!r} is no length with its unit (mm, cm or m), such as 226mm or -0.205m")
    return float(found[1]) * _UNITS[found[2]]


def _paired(runs: list[SquareRun], ends: list[tuple[str, Pose]]) -> list[tuple[SquareRun, Pose]]:
    """Each measured end with the recorded run of its direction, both in the order of driving."""
    from medusa.errors import CommandError

    paired: list[tuple[SquareRun, Pose]] = []
    for direction in ("ccw", "cw"):
        driven = [run for run in runs if run.direction == direction]
        seen = [end for way, end in ends if way == direction]
        if len(driven) != len(seen):
            raise CommandError(
                f"{len(driven)} recorded {direction} runs, but {len(seen)} measured: one --measured a run"
            )
        paired += zip(driven, seen, strict=True)
    return paired
