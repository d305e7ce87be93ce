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
) -> None:
    """Write a commented configuration, its hazardous keys empty; with --sim, filled in for the emulated head."""
    options: Options = context.obj

    async def body() -> None:
        from medusa.config.file import template
        from medusa.errors import CommandError
        from medusa.files.replace_file import replace_file
        from medusa.mc3000.simulated_config import simulated_toml

        if file.exists() and not force:
            raise CommandError(f"{file} exists; --force replaces it")
        replace_file(file, simulated_toml() if options.sim else template())
        options.progress(f"wrote {file}" + ("" if options.sim else "; fill in the keys that are empty"))
        options.show({"file": str(file)}, lambda: None)

    options.run(body)
