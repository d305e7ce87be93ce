"""medusa-ctl init: the configuration to fill in."""

from pathlib import Path
from typing import Annotated

import typer

from medusa.cli.options import Options


def register(app: typer.Typer) -> None:
    app.command()(init)


def init(
    context: typer.Context,
    file: Annotated[Path, typer.Argument(help="Where to write it.")] = Path("medusa.toml"),
    force: bool = typer.Option(False, "--force", help="Replace a file that is there."),
    drive: str = typer.Option(
        "mc3000", help="What moves the head: mc3000, or ideal for a head without hardware."
    ),
) -> None:
    """Write a commented configuration, its hazardous keys empty; with --sim, filled in for the emulated head."""
    options: Options = context.obj

    async def body() -> None:
        from medusa.config.file import template
        from medusa.errors import CommandError
        from medusa.files.replace_file import replace_file
        from medusa.machines import MACHINES
        from medusa.mc3000.simulated_config import simulated_toml

        if drive not in MACHINES:
            raise CommandError(f"there is no drive {drive!r}; there is {', '.join(MACHINES)}")
        if file.exists() and not force:
            raise CommandError(f"{file} exists; --force replaces it")
        text = simulated_toml() if options.sim else template(drive)
        replace_file(file, text)
        options.progress(f"wrote {file}" + ("; fill in the keys that are empty" if ' = ""' in text else ""))
        options.show({"file": str(file)}, lambda: None)

    options.run(body)
