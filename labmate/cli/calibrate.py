"""The calibration from recorded squares and the operator's tape measure."""

from __future__ import annotations

import re
from pathlib import Path
from typing import TYPE_CHECKING

import typer

from labmate.cli.options import Options
from labmate.cli.square import OUT, square_in_simulation
from labmate.cli.tables import print_values

if TYPE_CHECKING:
    from labmate.calibration import Calibration
    from labmate.odometry import Pose
    from labmate.square import SquareRun

_RECORD = f"{OUT}/square.json"
_UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0}


def register(app: typer.Typer) -> None:
    app.command()(calibrate)


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
        square_in_simulation(options, 4.0, Path(OUT), Path(out))
        return
    if not measured:
        options.fail(
            "nothing measured: --measured ccw=X,Y --measured cw=X,Y, each with its unit, for example 226mm"
        )

    async def body() -> Calibration:
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
        return found

    found = options.run(body)
    from labmate.square_report import calibration_in_words

    document = calibration_in_words(found) | {"written": out}
    options.show(document, lambda: print_values("calibration", document))


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
