"""A live view of the base."""

from __future__ import annotations

import asyncio
import sys
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

import typer

from labmate.cli.options import Options
from labmate.cli.tables import snapshot_document
from medusa.console import make_table

if TYPE_CHECKING:
    from labmate.base.reading import BaseReading


def register(app: typer.Typer) -> None:
    app.command()(monitor)


def monitor(
    context: typer.Context,
    rate: float = typer.Option(5.0, min=0.1, max=50.0, metavar="HZ", help="Snapshots a second."),
    seconds: float = typer.Option(0.0, "--for", min=0.0, metavar="S", help="For how long; 0: until Ctrl-C."),
) -> None:
    """Watch pose, speed, bumpers and battery; with --json all snapshots at the end."""
    options: Options = context.obj
    documents: list[dict[str, Any]] = []

    async def body() -> None:
        from rich.live import Live

        loop = asyncio.get_running_loop()
        async with options.base() as (base, _):
            with Live(auto_refresh=False, console=_console(options)) as view:
                started = loop.time()
                async for snapshot in base.readings(rate):
                    at = round(snapshot.time - started, 3)
                    if options.json:
                        documents.append({"t": at} | snapshot_document(snapshot))
                    else:
                        view.update(live_table(snapshot, {}), refresh=True)
                    if seconds > 0.0 and loop.time() - started >= seconds:
                        break

    options.run(body, realtime=seconds <= 0.0)
    options.show({"snapshots": documents}, lambda: None)


def live_table(snapshot: BaseReading, more: Mapping[str, Any]) -> Any:
    """What a driver wants to see."""
    document = snapshot_document(snapshot)
    rows = {
        "mode": document["mode"],
        "pose": _place(document["pose"]),
        "odometry": _place(document["odometry"]),
        "speed": f"{document['speed_m_s']:7.3f} m/s   {document['turn_rate_deg_s']:7.2f}°/s",
        "bumpers": document["bumpers"],
        "battery": f"{document['battery_v']:.2f} V" + (" LOW" if document["battery_low"] else ""),
        "latched": ", ".join(name for name in ("emergency_stop", "stalled") if document[name]) or "nothing",
    } | dict(more)
    return make_table("Labmate", [{"": key, "now": value} for key, value in rows.items()])


def _place(pose: Mapping[str, float]) -> str:
    return f"x {pose['x_m']:8.3f} m   y {pose['y_m']:8.3f} m   heading {pose['heading_deg']:8.2f}°"


def _console(options: Options) -> Any:
    from rich.console import Console

    return Console(file=sys.stderr if options.json else sys.stdout)
