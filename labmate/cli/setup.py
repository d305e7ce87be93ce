"""Commands that look at the base and write its configuration; nothing moves."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import typer

from labmate.cli.options import DEFAULT_FILE, Options
from labmate.cli.tables import pose_line, print_values, snapshot_document

if TYPE_CHECKING:
    from labmate.base.reading import BaseReading


def register(app: typer.Typer) -> None:
    app.command()(init)
    app.command()(status)
    app.command(context_settings={"ignore_unknown_options": True})(pose)


def init(
    context: typer.Context,
    file: str = typer.Argument(DEFAULT_FILE, help="Where to write it."),
    force: bool = typer.Option(False, "--force", help="Overwrite what is there."),
) -> None:
    """Write a commented configuration, its hazardous keys empty (with --sim: filled for the emulated base)."""
    options: Options = context.obj
    path = Path(file)
    if path.exists() and not force:
        options.fail(f"{file} exists; --force overwrites it")

    async def body() -> None:
        from labmate.config import template
        from labmate.simulation import SIM_VALUES
        from medusa.files.replace_file import replace_file

        replace_file(path, template(SIM_VALUES if options.sim else None))

    options.run(body)
    filled = "filled for the emulated base" if options.sim else "now fill in its empty keys"
    options.show({"written": file}, lambda: print(f"{file} written; {filled}"))


def status(context: typer.Context) -> None:
    """What the base reports of itself: mode, flags, battery, line statistics."""
    options: Options = context.obj

    async def body() -> tuple[BaseReading, dict[str, Any]]:
        async with options.base() as (base, _):
            snapshot = await base.read()
            facts: dict[str, Any] = {
                **base.driver.facts,
                "odometry_wheel_base_mm": round(1e3 * base.geometry.wheel_base, 4),
                "odometry_wheel_ratio": round(base.geometry.wheel_ratio, 8),
                **await base.driver.counters(),
            }
        return snapshot, facts

    snapshot, facts = options.run(body)
    document = snapshot_document(snapshot) | facts
    options.show(document, lambda: print_values("Labmate", document))


def pose(
    context: typer.Context,
    set_to: tuple[float, float, float] = typer.Option(
        None, "--set", metavar="X Y HEADING", help="Set the pose of the base at rest: m, m, degrees."
    ),
) -> None:
    """The base's pose, by its own odometry."""
    options: Options = context.obj

    async def body() -> tuple[BaseReading, dict[str, Any]]:
        from math import radians

        from labmate.odometry import Pose
        from labmate.square_report import pose_in_words

        async with options.base() as (base, simulated):
            if set_to is not None:
                x, y, heading = set_to
                await base.set_pose(Pose(x, y, radians(heading)))
            snapshot = await base.read()
            true = {"true_pose": pose_in_words(simulated.true_pose())} if simulated is not None else {}
        return snapshot, true

    snapshot, true = options.run(body)
    options.show(snapshot_document(snapshot) | true, lambda: print(pose_line(snapshot)))
