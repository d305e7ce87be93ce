"""sim-devices: serve the emulated devices from a process of their own, look into them and disturb them."""

import json
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NoReturn

import typer

if TYPE_CHECKING:
    from sim_devices.assembly import BenchConfig
    from sim_devices.config import Faults

app = typer.Typer(add_completion=False, no_args_is_help=True, pretty_exceptions_enable=False)

Links = Annotated[
    Path, typer.Option("--links", metavar="DIR", help="Where the links and the control socket are made.")
]
DEFAULT_LINKS = Path("sim")


def main() -> None:
    """Run the command line; a wrong argument gets one line and exit code 2."""
    # typer's usage error is the class above the one that it exports.
    usage_error: type[Exception] = typer.BadParameter.__mro__[1]
    try:
        sys.exit(app(prog_name="sim-devices", standalone_mode=False))
    except usage_error as error:
        text = error.format_message() if isinstance(error, typer.BadParameter) else str(error)
        # A call without any command has shown the help already.
        if text:
            print(f"sim-devices: {' '.join(text.split())}", file=sys.stderr)
        sys.exit(2)
    except typer.Abort:
        sys.exit(130)


@app.callback()
def _sim_devices() -> None:
    """Emulators of the head's boards and amplifiers and of the Labmate, behind pseudo-terminals."""


@app.command()
def run(
    config: Annotated[Path | None, typer.Option(metavar="F", help="TOML: what stands on the bench.")] = None,
    links: Links = DEFAULT_LINKS,
    seed: Annotated[int | None, typer.Option(help="Fixes boot counts, start positions and faults.")] = None,
    faults: Annotated[
        Path | None, typer.Option(metavar="F", help="TOML: what the wires do, and what happens when.")
    ] = None,
    speed: Annotated[float, typer.Option(metavar="X", help="Seconds of the bench in one second.")] = 1.0,
    log: Annotated[str, typer.Option(help="debug, info, warning or error.")] = "warning",
) -> None:
    """Serve DIR/mc3000, DIR/servo-amps, DIR/labmate and all cameras until SIGINT or SIGTERM.

    Prints a line for each port and camera, then "ready".
    """
    from sim_devices.assembly import read_bench
    from sim_devices.config import ConfigError, Faults, read_faults

    if not 0.001 <= speed <= 1000:
        _fail(f"--speed is {speed:g}, must be from 0.001 to 1000", 2)
    _set_log(log)
    try:
        bench = read_bench(config)
        plan = read_faults(faults) if faults is not None else Faults()
    except ConfigError as error:
        _fail(str(error), 2)
    _serve(bench, plan, links, seed, speed)


def _serve(config: "BenchConfig", faults: "Faults", links: Path, seed: int | None, speed: float) -> None:
    import asyncio

    from sim_devices.clock import ScaledTimeLoop
    from sim_devices.control import ControlError
    from sim_devices.server import serve

    try:
        links.mkdir(parents=True, exist_ok=True)
        with asyncio.Runner(loop_factory=lambda: ScaledTimeLoop(speed)) as runner:
            runner.run(serve(config, faults, links, seed, announce=_announce))
    except (OSError, ValueError, ControlError) as error:
        where = getattr(error, "filename", None) or links
        _fail(f"{where}: {error.strerror}" if isinstance(error, OSError) else str(error), 1)


@app.command()
def inspect(links: Links = DEFAULT_LINKS) -> None:
    """Print the true state of everything on a running bench, as JSON in SI units and radians."""
    typer.echo(json.dumps(_call(links, "inspect"), indent=2))


@app.command()
def inject(
    verb: Annotated[str | None, typer.Argument(help="For instance base.press_bumper.")] = None,
    arguments: Annotated[
        list[str] | None, typer.Argument(metavar="NAME=VALUE", help="For instance side=front.")
    ] = None,
    links: Links = DEFAULT_LINKS,
) -> None:
    """Do something to a running bench. Without a verb: list the verbs and their arguments."""
    if verb is None:
        for name, description in _call(links, "verbs").items():
            typer.echo(f"{name}{description}")
        return
    result = _call(links, verb, _parse(arguments or []))
    if result is not None:
        typer.echo(json.dumps(result, indent=2))


def _announce(line: str) -> None:
    # Whoever started the process waits for these lines.
    print(line, flush=True)


def _call(links: Path, verb: str, arguments: dict[str, Any] | None = None) -> Any:
    from sim_devices.control import ControlError, call

    try:
        return call(links, verb, arguments)
    except ControlError as error:
        _fail(str(error), 1)


def _parse(arguments: list[str]) -> dict[str, Any]:
    parsed: dict[str, Any] = {}
    for argument in arguments:
        name, equals, text = argument.partition("=")
        if not (equals and name.isidentifier()):
            _fail(f"{argument!r} is not of the form NAME=VALUE", 2)
        try:
            parsed[name] = json.loads(text)
        except ValueError:
            parsed[name] = text
    return parsed


def _set_log(level: str) -> None:
    import logging

    number = logging.getLevelNamesMapping().get(level.upper())
    if number is None or level.lower() not in ("debug", "info", "warning", "error"):
        _fail(f"--log is {level!r}, must be debug, info, warning or error", 2)
    logging.basicConfig(level=number, format="%(levelname)s %(name)s: %(message)s", stream=sys.stderr)


def _fail(message: str, code: int) -> NoReturn:
    typer.echo(f"sim-devices: {message}", err=True)
    raise typer.Exit(code)
