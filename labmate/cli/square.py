"""The square: both ways in simulation, one way at a time on the floor."""

from __future__ import annotations

import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from labmate.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from labmate.calibration import Direction
    from labmate.odometry import Pose, WheelGeometry
    from labmate.square import Progress, SquareResult, SquareRun

OUT = "labmate-square"


def register(app: typer.Typer) -> None:
    app.command()(square)


def square(
    context: typer.Context,
    side: float = typer.Option(4.0, min=0.1, max=20.0, metavar="M", help="Side of the square."),
    direction: str = typer.Option(
        "", metavar="ccw|cw", help="On the floor: one way at a time, measured in between."
    ),
    out: str = typer.Option(OUT, metavar="DIR", help="Where record, picture and calibration go."),
) -> None:
    """Drive a square both ways, calibrate the odometry from its closing errors, and drive it again calibrated."""
    options: Options = context.obj
    if direction not in ("", "ccw", "cw"):
        options.fail(f"--direction is ccw or cw, not {direction}")
    if options.sim:
        if direction:
            options.fail("--sim drives both ways and sees where the base is: leave --direction out")
        square_in_simulation(options, side, Path(out))
    elif not direction:
        options.fail(
            "on the floor one way at a time: --direction ccw, measure where it came to rest, then --direction cw"
        )
    else:
        _square_on_the_floor(options, side, "ccw" if direction == "ccw" else "cw", Path(out))


def square_in_simulation(options: Options, side: float, out: Path, calibration: Path | None = None) -> None:
    """Drive both ways, calibrate by the true pose, drive both again; `calibration`: where it goes, else into `out`."""

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
        from labmate.square_report import (
            CALIBRATION_NAME,
            FIGURE_NAME,
            RECORD_NAME,
            draw,
            summary,
            write_record,
        )
        from medusa.files.replace_file import replace_file

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
        from labmate.square import drive_square
        from labmate.square_report import RECORD_NAME, read_record, require_writable, write_record

        path = out / RECORD_NAME
        require_writable(out)
        earlier = read_record(path)[0] if path.exists() else []
        async with options.base() as (base, _):
            calibration = base.calibration
            with _progress(options, 8 if calibration is None else 9) as progress:
                run = await drive_square(base, direction, side, calibration=calibration, progress=progress)
            nominal, geometry = base.wheels, base.geometry
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
            "s": f"{run['seconds']:.1f}",
            "true end x mm": f"{1e3 * run['true_end']['x_m']:.1f}",
            "y mm": f"{1e3 * run['true_end']['y_m']:.1f}",
            "heading °": f"{run['true_end']['heading_deg']:.2f}",
            "closing mm": f"{run['closing_mm']['distance']:.2f}",
        }
        for run in document["runs"]
    ]
    print_table("squares: where the base really ended, and how far the odometry was off", rows)
    found = document["calibration"]
    rows = [
        {
            "": name,
            "nominal": str(round(document["nominal"][key], 5)),
            "estimated": str(found[key]),
            "±": str(found[deviation]),
            "true": str(document["true"][key]),
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
            run = f"{progress.direction}{', calibrated' if progress.calibrated else ''}"
            p = progress.reading.pose
            at = f"leg {progress.done} of {progress.of}, odometry at {p.x:.3f}, {p.y:.3f} m"
            if console.is_terminal:
                bars.update(bar, completed=len(done), description=f"{run}: {at}")
            else:
                options.progress(f"{run}: {at}")

        yield show
        bars.update(bar, completed=legs)
    sys.stderr.flush()
