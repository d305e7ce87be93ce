"""Commands that move the head, or keep it from moving."""

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import TYPE_CHECKING, Annotated, Any

import typer

from medusa.cli.options import Options
from medusa.console import print_table

if TYPE_CHECKING:
    from medusa.head.faults import Cause
    from medusa.head.joint_group import JointGroup
    from medusa.head.moves import MoveReport

AXES = "pan, tilt, left_vergence, right_vergence"


def register(app: typer.Typer) -> None:
    for command in (check, home, move, stop, estop, clear, park):
        app.command()(command)
    # Else a negative speed would be taken for an option.
    app.command(context_settings={"ignore_unknown_options": True})(jog)


def check(context: typer.Context, axis: str = typer.Argument(..., help=f"One of {AXES}.")) -> None:
    """The first thing to do on hardware: short open-loop pulses, and the counts must follow with the right sign."""
    options: Options = context.obj

    async def body() -> None:
        from medusa.mc3000.wiring_check import check_axis

        async with options.head() as (head, _):
            _known(head, axis)
            found = await check_axis(head, axis)
        document = {
            "axis": axis,
            "motor_command_counts": found.motor_command_counts,
            "forward_counts": found.forward_counts,
            "backward_counts": found.backward_counts,
        }
        options.show(
            document,
            lambda: print(
                f"{axis}: {found.forward_counts:+d} and {found.backward_counts:+d} counts at"
                f" ±{found.motor_command_counts} DAC counts; wired as configured"
            ),
        )

    options.run(body)


def home(
    context: typer.Context,
    axes: Annotated[list[str] | None, typer.Argument(help=f"Default all: {AXES}.")] = None,
) -> None:
    """Find the home sensors, set the zeros, go to the home angles."""
    options: Options = context.obj

    async def body() -> None:
        async with options.head() as (head, _):
            for name in axes or ():
                _known(head, name)
            results = await head.home(axes or None)
        rows = []
        for name, homed in results.items():
            details = dict(homed.details)
            error = {"error_counts": details.pop("error_counts")} if "error_counts" in details else {}
            angle = round(math.degrees(homed.angle), 4)
            rows.append(
                {"axis": name, **details, "angle_deg": angle, **error, "seconds": round(homed.seconds, 3)}
            )
        options.show({"homed": rows}, lambda: print_table("homed", rows))

    options.run(body)


def move(
    context: typer.Context,
    pan: float = typer.Option(None, help="Degrees, positive left."),
    tilt: float = typer.Option(None, help="Degrees, positive down."),
    left: float = typer.Option(None, help="Left eye, degrees, positive left."),
    right: float = typer.Option(None, help="Right eye, degrees, positive left."),
) -> None:
    """Move joints together, each by its own trapezoid, and wait until they are at rest."""
    options: Options = context.obj
    angles = {"pan": pan, "tilt": tilt, "left_vergence": left, "right_vergence": right}
    targets = {name: angle for name, angle in angles.items() if angle is not None}
    if not targets:
        options.fail("nowhere to move: give --pan, --tilt, --left or --right", 2)

    async def body() -> None:
        async with options.head(homed=True, joints=targets) as (head, _):
            report = await head.move({name: math.radians(angle) for name, angle in targets.items()})
        errors = error_counts(head, report)
        rows = [
            {
                "axis": name,
                "target_deg": round(targets[name], 4),
                "angle_deg": round(math.degrees(report.reading.joints[name].angle), 4),
                **errors[name],
                "profile_ms": round(1e3 * report.plan.seconds[name], 1),
                "settled": report.settled[name],
            }
            for name in targets
        ]
        document: dict[str, Any] = {
            "moved": rows,
            "skew_ms": round(1e3 * report.start_skew, 3),
            "starts_repeated_on": list(report.ends.repeated),
        }
        options.show(document, lambda: print_table("moved", rows))

    options.run(body)


def error_counts(head: "JointGroup", report: "MoveReport") -> dict[str, dict[str, int]]:
    """By joint the error at the end in counts, where the machine has counts."""
    errors = {}
    for name, now in head.drive.details(report.reading).items():
        planned = report.plan.details.get(name, {})
        has_counts = "final_counts" in planned and "position_counts" in now
        errors[name] = (
            {"error_counts": planned["final_counts"] - now["position_counts"]} if has_counts else {}
        )
    return errors


def jog(
    context: typer.Context,
    axis: str = typer.Argument(..., help=f"One of {AXES}."),
    speed: float = typer.Argument(..., help="Degrees per second; the sign is the direction."),
    seconds: float = typer.Option(1.0, min=0.0, max=600.0, help="For how long; Ctrl-C ends it before."),
) -> None:
    """Turn one joint at a speed, and stop it."""
    options: Options = context.obj

    async def body() -> None:
        from medusa.head.faults import JointFault

        async with options.head(homed=True, joints=[axis]) as (head, _):
            _known(head, axis)
            _check_speed(head, axis, speed)
            faults: asyncio.Future[Any] = asyncio.get_running_loop().create_future()
            end = head.subscribe(lambda fault: None if faults.done() else faults.set_result(fault))
            try:
                taken = await head.velocity({axis: math.radians(speed)})
                options.progress(f"{axis}: {math.degrees(taken[axis]):+.3f}°/s for {seconds:g} s")
                await asyncio.wait([faults], timeout=seconds)
            finally:
                end()
            if faults.done():
                raise JointFault(faults.result(), await head.stopped_by_fault())
            await head.stop()
            reading = await head.read()
        angle = math.degrees(reading.joints[axis].angle)
        options.show(
            {"axis": axis, "speed_deg_s": math.degrees(taken[axis]), "angle_deg": angle},
            lambda: print(f"{axis}: at rest at {angle:.3f}°"),
        )

    options.run(body)


def _check_speed(head: "JointGroup", name: str, speed_deg_s: float) -> None:
    """Raise CommandError for a speed that the machine would round to standstill."""
    from medusa.errors import CommandError

    slowest = math.degrees(head.traits[name].rate_step)
    if 0 < abs(speed_deg_s) < slowest / 2:
        raise CommandError(
            f"{name}: {speed_deg_s:g}°/s is less than half a step of its rate; the slowest is {slowest:.3f}°/s"
        )


def stop(context: typer.Context) -> None:
    """Stop every joint, confirmed by reading back."""
    _stop_and_confirm(context.obj, "stop", "every joint is at rest")


def estop(context: typer.Context) -> None:
    """Emergency stop: everything idle at once and latched, confirmed by reading back; `clear` releases it."""
    _stop_and_confirm(
        context.obj, "emergency_stop", "emergency stop latched, every joint idle", first=_latch_unanswered
    )


async def _latch_unanswered(options: Options) -> None:
    """Send the emergency stop before any handshake: boards that do not answer may still receive."""
    from medusa.errors import ConfigError
    from medusa.mc3000.config import Mc3000Config
    from medusa.mc3000.emergency_stop import send_emergency_stop

    try:
        config = options.head_config()
    except ConfigError as error:
        if options.boards is not None and not options.sim:
            await send_emergency_stop(options.boards, None)
            error.add_note(f"the emergency stop went out to all of {options.boards}, and cannot be confirmed")
        raise
    if options.sim or not isinstance(config, Mc3000Config):
        return
    path = options.boards or config.ports.boards
    if path is not None:
        await send_emergency_stop(path, config)


def _stop_and_confirm(
    options: Options, what: str, state: str, first: Callable[[Options], Awaitable[None]] | None = None
) -> None:
    async def body() -> None:
        if first is not None:
            await first(options)
        async with options.head(amplifiers=False) as (head, _):
            await getattr(head, what)()
        options.show({"confirmed": True}, lambda: print(state))

    options.run(body)


def clear(context: typer.Context) -> None:
    """Release latched stops and faults whose cause is gone; moves nothing."""
    options: Options = context.obj

    async def body() -> None:
        async with options.head() as (head, _):
            left = {name: latched_names(causes) for name, causes in (await head.clear()).items()}
        options.show(
            {"still_latched": left},
            lambda: print(
                "nothing is latched"
                if not left
                else "still latched: " + ", ".join(f"{n}: {i}" for n, i in left.items())
            ),
        )

    options.run(body)


def latched_names(causes: "frozenset[Cause]") -> str:
    """Latched causes as documents name them: LIMIT_LATCHED, EMERGENCY_STOP_LATCHED, FAULT_LATCHED."""
    from medusa.head.faults import Cause

    return "|".join(
        f"{'FAULT' if cause is Cause.DRIVE else cause.name}_LATCHED" for cause in Cause if cause in causes
    )


def park(context: typer.Context) -> None:
    """Move to the park angles, go idle, inhibit the amplifiers."""
    options: Options = context.obj

    async def body() -> None:
        async with options.head(homed=True) as (head, _):
            report = await head.park()
        angles = {n: round(math.degrees(j.angle), 4) for n, j in report.reading.joints.items()}
        options.show(
            {"parked_deg": angles},
            lambda: print("parked: " + ", ".join(f"{name} {angle:.3f}°" for name, angle in angles.items())),
        )

    options.run(body)


def _known(head: "JointGroup", name: str) -> None:
    from medusa.errors import CommandError

    if name not in head.traits:
        raise CommandError(f"there is no joint {name!r}; the head has {', '.join(head.traits)}")
