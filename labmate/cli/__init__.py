"""labmate-drive: the base from the command line. Metres and degrees."""

import typer

from labmate.cli import calibrate, motion, setup, square, teleop, watch
from labmate.cli.options import Options
from medusa.console import make_app, run_program

app = make_app(Options.program, Options.machine)


@app.callback()
def _labmate_drive(
    context: typer.Context,
    sim: bool = typer.Option(False, "--sim", help="An emulated base in this process, in virtual time."),
    port: str = typer.Option("", metavar="PORT", help="The base's serial port."),
    config: str = typer.Option("", metavar="FILE", help="The base's configuration.  [default: labmate.toml]"),
    calibration: str = typer.Option(
        "", metavar="FILE", help="The odometry's calibration, over the configured one."
    ),
    json: bool = typer.Option(False, "--json", help="One JSON document on stdout, all else on stderr."),
    trace: str = typer.Option("", metavar="FILE", help="Record what goes over the line."),
    seed: int = typer.Option(0, min=0, help="With --sim: boot count and nonces."),
    realtime: bool = typer.Option(False, "--realtime", help="With --sim: on the wall clock."),
    verbose: bool = typer.Option(False, "--verbose", help="Log what is being done."),
) -> None:
    """Drive the Labmate base: lengths in metres, angles in degrees, positive left.

    Options may be given before or after the command.
    """
    context.obj = Options(
        sim=sim,
        port=port or None,
        config=config or None,
        calibration=calibration or None,
        json=json,
        trace=trace or None,
        seed=seed,
        realtime=realtime,
        verbose=verbose,
    )


for group in (setup, motion, watch, teleop, square, calibrate):
    group.register(app)


def main() -> None:
    """Run the command line."""
    run_program(app, Options.program)
