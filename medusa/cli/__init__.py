"""medusa-ctl: the head from the command line. Angles are degrees here, and only here."""

import sys

import typer

from medusa.cli import demo, machine, motion, setup
from medusa.cli.options import Options, globals_first

app = typer.Typer(
    name="medusa-ctl",
    add_completion=False,
    no_args_is_help=True,
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


@app.callback()
def _medusa_ctl(
    context: typer.Context,
    sim: bool = typer.Option(False, "--sim", help="An emulated head in this process, in virtual time."),
    boards: str = typer.Option("", metavar="PORT", help="Serial port of the MC3000 boards."),
    amps: str = typer.Option("", metavar="PORT", help="Serial port of the servo amplifiers."),
    config: str = typer.Option("", metavar="FILE", help="The head's configuration.  [default: medusa.toml]"),
    json: bool = typer.Option(False, "--json", help="One JSON document on stdout, all else on stderr."),
    trace: str = typer.Option("", metavar="FILE", help="Record what goes over the lines."),
    seed: int = typer.Option(0, min=0, help="With --sim: where the joints stand, boot counts, nonces."),
    realtime: bool = typer.Option(False, "--realtime", help="With --sim: on the wall clock."),
    verbose: bool = typer.Option(False, "--verbose", help="Say what is being done."),
) -> None:
    """Drive the Medusa stereo head: four joints on two MC3000 boards and four servo amplifiers.

    Options may stand before or after the command. Exit codes: 0 done, 2 wrong arguments or a command that
    cannot be done, 3 configuration, 4 port, 5 no answer or a wrong one, 6 the machine stopped by a fault, 130
    and 143 interrupted and stopped.
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


for group in (setup, machine, motion, demo):
    group.register(app)


def main() -> None:
    """Run the command line."""
    app(args=globals_first(sys.argv[1:]), prog_name="medusa-ctl")
