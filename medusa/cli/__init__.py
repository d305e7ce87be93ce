"""medusa-ctl: the head from the command line. Angles are degrees here, and only here."""

import typer

from medusa.cli import calibrate, demo, design, machine, motion, servo, setup, track
from medusa.cli.options import Options
from medusa.console import make_app, run_program

app = make_app(Options.program, Options.machine)


@app.callback()
def _medusa_ctl(
    context: typer.Context,
    sim: bool = typer.Option(False, "--sim", help="An emulated head in this process, in virtual time."),
    boards: str = typer.Option("", metavar="PORT", help="Serial port of the MC3000 boards."),
    amps: str = typer.Option("", metavar="PORT", help="Serial port of the servo amplifiers."),
    config: str = typer.Option("", metavar="FILE", help="The head's configuration; else medusa.toml."),
    json: bool = typer.Option(False, "--json", help="One JSON document on stdout, all else on stderr."),
    trace: str = typer.Option("", metavar="FILE", help="Record what goes over the lines."),
    seed: int = typer.Option(0, min=0, help="With --sim: start positions, boot counts, nonces."),
    realtime: bool = typer.Option(False, "--realtime", help="With --sim: on the wall clock."),
    verbose: bool = typer.Option(False, "--verbose", help="Log what is being done."),
) -> None:
    """Drive the Medusa stereo head: four joints on two MC3000 boards and four servo amplifiers.

    Options may be given before or after the command.
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
    """Run the command line."""
    run_program(app, Options.program)
