"""Commands that move the base, or keep it from moving."""

from __future__ import annotations

import asyncio
from contextlib import AsyncExitStack
from math import isfinite, radians
from typing import TYPE_CHECKING

import typer

from labmate.cli.options import Options
from labmate.cli.tables import pose_line, report_document, snapshot_document

if TYPE_CHECKING:
    from labmate.base.reading import BaseReading
    from labmate.base.report import MotionReport

# A negative distance is an argument, not an option.
_NEGATIVE = {"ignore_unknown_options": True}


def register(app: typer.Typer) -> None:
    for moving in (go, turn, drive):
        app.command(context_settings=_NEGATIVE)(moving)
    for still in (stop, estop, clear):
        app.command()(still)


def go(
    context: typer.Context, distance: float = typer.Argument(..., help="Metres; negative: backwards.")
) -> None:
    """Drive straight on, and report what ended it."""
    _travel(context.obj, "GO", distance)


def turn(context: typer.Context, angle: float = typer.Argument(..., help="Degrees, positive left.")) -> None:
    """Turn on the spot, and report what ended it."""
    _travel(context.obj, "TURN", angle)


def drive(
    context: typer.Context,
    speed: float = typer.Argument(..., help="Metres a second; negative: backwards."),
    turn_rate: float = typer.Argument(0.0, help="Degrees a second, positive left."),
    seconds: float = typer.Option(..., "--for", min=0.1, max=600.0, metavar="S", help="For how long."),
) -> None:
    """Drive at a speed and a turn rate for a while; each command lives 0.3 s, Ctrl-C ends it before."""
    options: Options = context.obj

    async def body() -> BaseReading:
        from labmate.base.checks import check_free_way, check_twist

        async with options.base() as (base, _):
            expires = base.can.expires
            check_twist(base.limits, expires, speed, radians(turn_rate), expires)
            check_free_way("DRIVE", await base.read(), speed, radians(turn_rate))
            loop = asyncio.get_running_loop()
            end = loop.time() + seconds
            async with base.motion() as motion:
                while loop.time() < end - 1e-3:
                    motion.twist(speed, radians(turn_rate))
                    await asyncio.sleep(min(0.1, end - loop.time()))
            return await base.read()

    _show(options, options.run(body), "at rest at")


def stop(context: typer.Context) -> None:
    """Ramp to a stop, and confirm it."""
    options: Options = context.obj

    async def body() -> BaseReading:
        async with options.base(to_stop=True) as (base, _):
            return await base.stop()

    _show(options, options.run(body), "at rest at")


def estop(context: typer.Context) -> None:
    """Stop at once and latch it, before anything else is asked; then confirm it."""
    options: Options = context.obj

    async def body() -> BaseReading:
        from labmate.base.mobile_base import MobileBase
        from labmate.driver.labmate import Labmate
        from labmate.driver.messages import DEFAULT_ADDRESS
        from medusa.link import Line

        if options.sim:
            async with options.base(to_stop=True) as (base, _):
                return await base.emergency_stop()
        config = options.config_to_stop_by()
        port = options.port_of(config)
        trace = options.open_trace()
        async with AsyncExitStack() as stack:
            if trace is not None:
                stack.callback(trace.close)
            baud, address = (
                (115200, DEFAULT_ADDRESS) if config is None else (config.port.baud, config.port.address)
            )
            line = await stack.enter_async_context(Line(port, baud=baud, trace=trace, name="labmate"))
            line.session(address)
            await line.emergency_stop()
            driver = Labmate(line, None, path=port, address=address)
            base = await stack.enter_async_context(MobileBase(driver))
            return await base.emergency_stop()

    _show(options, options.run(body), "emergency stop latched; at rest at")


def clear(context: typer.Context) -> None:
    """Release a latched emergency stop; nothing moves."""
    options: Options = context.obj

    async def body() -> BaseReading:
        async with options.base() as (base, _):
            return await base.clear()

    snapshot = options.run(body)
    from labmate.base.events import Cause

    latched = Cause.EMERGENCY_STOP in snapshot.latched
    _show(
        options,
        snapshot,
        "emergency stop still latched (is the button released?); at rest at"
        if latched
        else "clear; at rest at",
    )
    if latched:
        raise typer.Exit(6)


def _travel(options: Options, kind: str, amount: float) -> None:
    if not isfinite(amount):
        options.fail(f"{kind} needs a finite number, not {amount}")

    async def body() -> MotionReport:
        async with options.base() as (base, _):
            return await (base.go(amount) if kind == "GO" else base.turn(radians(amount)))

    report = options.run(body)
    options.show(report_document(report), lambda: print(report))


def _show(options: Options, snapshot: BaseReading, state: str) -> None:
    options.show(snapshot_document(snapshot), lambda: print(f"{state} {pose_line(snapshot)}"))
