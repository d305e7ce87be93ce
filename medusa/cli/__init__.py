"""medusa-ctl: the head from the command line. Angles are degrees here, and only here."""

import sys

import typer

from medusa.cli import calibrate, demo, design, machine, motion, servo, setup, track
from medusa.cli.options import Options, complain, globals_first

app = typer.Typer(
    name="medusa-ctl",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
    epilog=(
        "Exit codes: 0 done, 2 wrong arguments or a command that cannot be done, 3 configuration, 4 port,"
        " 5 no answer or a wrong one, 6 the machine stopped by a fault, 130 and 143 interrupted and stopped."
    ),
)


@app.callback()
def _medusa_ctl(
    context: typer.Context,
    sim: bool = typer.Option(False, "--sim", help="An emulated head in this process, in virtual time."),
    boards: str = typer.Option("", metavar="PORT", help="Serial port of the MC3000 boards."),
    amps: str = typer.Option("", metavar="PORT", help="Serial port of the servo amplifiers."),
    config: str = typer.Option("", metavar="FILE", help="The head's configuration; else medusa.toml."),
    json: bool = typer.Option(False, "--json", help="One JSON document on stdout, all else on stderr."),
    trace: str = typer.Option("", metavar="FILE", help="Record what goes over the lines."),
    seed: int = typer.Option(0, min=0, help="With --sim: where the joints stand, boot counts, nonces."),
    realtime: bool = typer.Option(False, "--realtime", help="With --sim: on the wall clock."),
    verbose: bool = typer.Option(False, "--verbose", help="Say what is being done."),
) -> None:
    """Drive the Medusa stereo head: four joints on two MC3000 boards and four servo amplifiers.

    Options may stand before or after the command.
    """
    context.obj = Options(
        sim=sim,
        boards=boards or None,
        amps=amps or None,
        config=config or None,
        json=json,
        trace=trace or None,
        seed=seed,
        realtime=realtime,
        verbose=verbose,
    )


for group in (setup, machine, motion, servo, design, demo, track, calibrate):
    group.register(app)


def main() -> None:
    """Run the command line; what the parser finds wrong is one line, too."""
    # typer brings its own copy of click and exports of its errors only BadParameter: the usage error is what that is.
    usage_error: type[Exception] = typer.BadParameter.__mro__[1]
    try:
        code = app(args=globals_first(sys.argv[1:]), prog_name="medusa-ctl", standalone_mode=False)
    except usage_error as error:
        told = getattr(error, "format_message", error.__str__)()
        if told:
            complain(
                f"{' '.join(told.split()).rstrip('.')}; see medusa-ctl --help", 2, json="--json" in sys.argv
            )
        else:
            app(args=["--help"], prog_name="medusa-ctl", standalone_mode=False)
        code = 2
    except (typer.Abort, KeyboardInterrupt):
        code = 130
    except BrokenPipeError:
        # Whoever read our output has gone.
        sys.stderr.close()
        code = 1
    sys.exit(code if isinstance(code, int) else 0)
