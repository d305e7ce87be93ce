"""medusa-ctl demo: the head enabled, homed, moved to a handful of gaze directions and parked."""

import asyncio
import contextlib
import json
import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.head.drive import Reading
    from medusa.head.joint_group import JointGroup

# Pan, tilt, version, vergence in degrees: a look around, near and far.
GAZES = (
    ("left, far", 40.0, -10.0, 12.0, 0.0),
    ("right, up", -50.0, -25.0, -10.0, 2.0),
    ("at the hands", 0.0, 30.0, 0.0, 18.0),
    ("left, near", 20.0, 10.0, 15.0, 10.0),
    ("straight ahead", 0.0, 0.0, 0.0, 4.0),
)


def register(app: typer.Typer) -> None:
    app.command()(demo)


def demo(
    context: typer.Context,
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where table and picture go.")] = Path(
        "out/demo"
    ),
    rate: float = typer.Option(20.0, min=1.0, max=50.0, help="Readings a second."),
    dwell: float = typer.Option(0.5, min=0.0, max=10.0, help="Seconds at each gaze direction."),
    picture: bool = typer.Option(True, help="Draw the picture."),
) -> None:
    """Enable, home, move together to a handful of gaze directions, park; leave a table and a picture."""
    options: Options = context.obj
    options.make_folder(out)
    document, readings = run_demo(options, rate, dwell)
    try:
        (out / "demo.json").write_text(json.dumps(document, indent=1) + "\n", encoding="utf-8")
        if picture:
            from medusa.cli.demo_figure import draw_demo

            draw_demo(readings, [(m["name"], m["time_s"]) for m in document["marks"]], out / "demo.png")
    except OSError as error:
        options.fail(f"{error.filename or out}: {error.strerror}", 4)
    options.show(
        document, lambda: print_table("gaze directions, degrees", [_short(row) for row in document["gazes"]])
    )
    options.progress(f"left behind: {out / 'demo.json'}" + (f", {out / 'demo.png'}" if picture else ""))


def run_demo(options: Options, rate: float, dwell: float) -> "tuple[dict[str, Any], list[Reading]]":
    """The demo itself: what it reached, and its readings."""
    readings: list[Reading] = []

    async def body() -> dict[str, Any]:
        from medusa.kinematics import Joints, eyes_from_version

        loop = asyncio.get_running_loop()
        async with options.head() as (head, _):
            camera = loop.create_task(_record(head, rate, readings), name="record the demo")
            try:
                options.progress("enable and home")
                await head.home()
                marks = [("home", loop.time())]
                rows = []
                for name, pan, tilt, version, vergence in GAZES:
                    options.progress(f"look {name}")
                    angles = Joints(pan, tilt, *eyes_from_version(version, vergence)).as_axes()
                    report = await head.move({axis: math.radians(angle) for axis, angle in angles.items()})
                    rows.append(_row(name, angles, report))
                    await asyncio.sleep(dwell)
                    marks.append((name, loop.time()))
                options.progress("park")
                await head.park()
                marks.append(("parked", loop.time()))
            finally:
                camera.cancel()
                await asyncio.gather(camera, return_exceptions=True)
        return {
            "gazes": rows,
            "seconds": round(marks[-1][1], 3),
            "marks": [{"name": name, "time_s": round(time, 3)} for name, time in marks],
        }

    return options.run(body), readings


async def _record(head: "JointGroup", rate: float, readings: "list[Reading]") -> None:
    with contextlib.suppress(asyncio.CancelledError):
        async for reading in head.readings(rate):
            readings.append(reading)


def _row(name: str, angles: dict[str, float], report: Any) -> dict[str, Any]:
    row: dict[str, Any] = {"gaze": name}
    for axis, angle in angles.items():
        row[axis] = round(angle, 3)
    for axis in angles:
        row[f"{axis}_error"] = round(math.degrees(report.reading.joints[axis].angle) - angles[axis], 4)
    row["slowest_ms"] = round(1e3 * report.plan.duration, 1)
    row["settled"] = report.all_settled
    return row


def _short(row: dict[str, Any]) -> dict[str, Any]:
    """What of a row fits on eighty columns."""
    errors = [abs(value) for key, value in row.items() if key.endswith("_error")]
    return {
        "gaze": row["gaze"],
        "pan": row["pan"],
        "tilt": row["tilt"],
        "left": row["left_vergence"],
        "right": row["right_vergence"],
        "error": max(errors),
        "ms": row["slowest_ms"],
        "settled": row["settled"],
    }
