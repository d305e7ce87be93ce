"""labmate-drive: the base from the command line. Metres and degrees."""

import sys

import typer

from labmate.cli import calibrate, motion, setup, square, teleop, watch
from labmate.cli.options import Options, globals_first

app = typer.Typer(
    name="labmate-drive",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


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
    verbose: bool = typer.Option(False, "--verbose", help="Say what is being done."),
) -> None:
    """Drive the Labmate base: lengths in metres, angles in degrees, positive left.

    Options may stand before or after the command. Exit codes: 0 done, 2 wrong arguments or a command that
    cannot be done (nothing moved), 3 configuration or calibration file, 4 port, 5 no answer or a wrong one,
    6 the base stopped before its goal or its stop is not confirmed, 129, 130 and 143 interrupted and stopped.
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
    arguments = globals_first(sys.argv[1:])
    # What the parser finds wrong with the arguments, in one line.
    usage_error: type[Exception] = typer.BadParameter.__mro__[1]
    try:
        code = app(args=arguments, prog_name="labmate-drive", standalone_mode=False)
    except usage_error as error:
        told = (
            " ".join(error.format_message().split()) if isinstance(error, typer.BadParameter) else str(error)
        )
        if told:
            # Without any argument the help has just been shown.
            print(f"labmate-drive: {told.rstrip('.')}; see labmate-drive --help", file=sys.stderr)
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:
        # Whoever read our output has gone.
        sys.stderr.close()
        code = 1
    sys.exit(code if isinstance(code, int) else 0)
