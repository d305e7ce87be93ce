"""Commands that look at the machine and move nothing."""

import asyncio
import math
from typing import TYPE_CHECKING, Any

import typer

from medusa.cli.options import Options
from medusa.console import make_table, print_table

if TYPE_CHECKING:
    from medusa.head.drive import Reading
    from medusa.head.joint_group import JointGroup
    from medusa.mc3000.axis import Axis

raw = typer.Typer(
    no_args_is_help=True, help="Read or write registers of an axis chip. Knows no limits: see the page."
)


def register(app: typer.Typer) -> None:
    for command in (info, status, amps, monitor):
        app.command()(command)
    app.add_typer(raw, name="raw")


def info(context: typer.Context) -> None:
    """What is connected: boards, firmware, boot counts, amplifiers."""
    options: Options = context.obj

    async def body() -> None:
        from medusa.mc3000.drive import Mc3000Drive

        async with options.head() as (head, _):
            drive = Mc3000Drive.of(head)
            boards = [
                {
                    "board": f"{address:02X}H",
                    "firmware": f"{board.firmware >> 8}.{board.firmware & 0xFF}",
                    "boot_count": board.boot_count,
                    "clock_hz": board.clock_hz,
                    "axes": ", ".join(n for n, a in drive.axes.items() if a.board is board),
                }
                for address, board in drive.boards.items()
            ]
            amplifiers = [
                {"axis": name, "amplifier": f"{a.address:02X}H", "name": await a.name()}
                for name, a in drive.amplifiers.items()
            ]

        def render() -> None:
            print_table("boards", boards)
            print_table("amplifiers", amplifiers)

        options.show({"boards": boards, "amplifiers": amplifiers}, render)

    options.run(body)


def joint_rows(head: "JointGroup", reading: "Reading") -> list[dict[str, Any]]:
    """One row a joint; angles that are not known yet are None."""
    rows = []
    for name, details in head.drive.details(reading).items():
        joint = reading.joints[name]
        angle = None if math.isnan(joint.angle) else round(math.degrees(joint.angle), 4)
        mode = {"mode": details.pop("mode")} if "mode" in details else {}
        rows.append({"axis": name, "homed": joint.homed, **mode, "angle_deg": angle, **details})
    return rows


def status(context: typer.Context) -> None:
    """Position of every joint, what is latched, what the amplifiers report."""
    options: Options = context.obj

    async def body() -> None:
        async with options.head() as (head, _):
            rows = joint_rows(head, await head.read())
            amplifiers = await _amplifier_rows(head)

        def render() -> None:
            print_table("joints", rows)
            if amplifiers:
                print_table("amplifiers", amplifiers)

        options.show({"joints": rows, "amplifiers": amplifiers}, render)

    options.run(body)


async def _amplifier_rows(head: "JointGroup") -> list[dict[str, Any]]:
    from medusa.mc3000.drive import Mc3000Drive

    rows = []
    amplifiers = head.drive.amplifiers if isinstance(head.drive, Mc3000Drive) else {}
    for name, amplifier in amplifiers.items():
        found = await amplifier.status()
        rows.append(
            {
                "axis": name,
                "bridge": "enabled" if found.enabled else "braked" if found.braked else "off",
                "faults": ", ".join(found.faults) or "–",
                "drive": ", ".join(sorted(found.drive_1 | found.drive_2)) or "–",
                "bus_v": round(await amplifier.bus_voltage(), 1),
                "current_a": round(await amplifier.current(), 3),
                "speed_counts_s": round(await amplifier.velocity_counts_s(), 1),
            }
        )
    return rows


def amps(context: typer.Context) -> None:
    """What the servo amplifiers report: enabled or not, faults, bus voltage, current, speed."""
    options: Options = context.obj

    async def body() -> None:
        async with options.head() as (head, _):
            rows = await _amplifier_rows(head)
        options.show({"amplifiers": rows}, lambda: print_table("amplifiers", rows))

    options.run(body)


def monitor(
    context: typer.Context,
    rate: float = typer.Option(10.0, min=0.1, max=100.0, help="Looks a second."),
    seconds: float = typer.Option(0.0, min=0.0, help="For how long; 0: until Ctrl-C."),
) -> None:
    """A live table of the joints. With --json, the last look when it ends, by Ctrl-C too."""
    options: Options = context.obj

    async def body() -> None:
        from rich.console import Console
        from rich.live import Live

        loop = asyncio.get_running_loop()
        rows: list[dict[str, Any]] = []
        async with options.head() as (head, _):
            began = loop.time()
            end = began + (seconds or math.inf)
            console = Console(stderr=options.json)
            with Live(console=console, auto_refresh=False) as live:
                async for reading in head.readings(rate):
                    rows = options.so_far["joints"] = joint_rows(head, reading)
                    title = f"joints, {reading.time - began:.1f} s after connecting"
                    live.update(make_table(title, rows), refresh=True)
                    if loop.time() >= end:
                        break
            if not console.is_terminal:
                console.line()
        options.show({"joints": rows}, lambda: None)

    # A table that nobody has time to read is none: the simulated head runs on the wall clock here.
    options.run(body, realtime=seconds == 0.0)


@raw.command()
def read(
    context: typer.Context,
    axis: str = typer.Argument(..., help="Which joint's chip."),
    register: str = typer.Argument(..., help="First address, hexadecimal: 0E or 0x0E."),
    count: int = typer.Argument(1, min=1, max=8, help="How many registers."),
) -> None:
    """Read registers, in ascending order of address."""
    options: Options = context.obj
    first = _byte(options, register)

    async def body() -> None:
        async with options.head() as (head, _):
            chip = _axis(head, axis)
            values = await chip.board.read(chip.channel, first, count)
        options.show(
            {"axis": axis, "register": first, "values": list(values)},
            lambda: print(" ".join(f"{first + i:02X}H={value:02X}H" for i, value in enumerate(values))),
        )

    options.run(body)


@raw.command()
def write(
    context: typer.Context,
    axis: str = typer.Argument(..., help="Which joint's chip."),
    register: str = typer.Argument(..., help="First address, hexadecimal."),
    values: list[str] = typer.Argument(..., help="One to eight bytes, hexadecimal."),
) -> None:
    """Write registers, all before the next sample; the board refuses what its page refuses."""
    options: Options = context.obj
    first = _byte(options, register)
    data = bytes(_byte(options, value) for value in values)

    async def body() -> None:
        async with options.head() as (head, _):
            chip = _axis(head, axis)
            await chip.board.write(chip.channel, first, data)
        options.show({"axis": axis, "register": first, "written": list(data)}, lambda: print("written"))

    options.run(body)


def _byte(options: Options, text: str) -> int:
    try:
        value = int(text, 16)
    except ValueError:
        value = -1
    if not 0 <= value <= 0xFF:
        options.fail(f"{text!r} is not a hexadecimal byte, 00 to FF", 2)
    return value


def _axis(head: "JointGroup", name: str) -> "Axis":
    from medusa.errors import CommandError
    from medusa.mc3000.drive import Mc3000Drive

    axes = Mc3000Drive.of(head).axes
    if name not in axes:
        raise CommandError(f"there is no joint {name!r}; the head has {', '.join(axes)}")
    return axes[name]
