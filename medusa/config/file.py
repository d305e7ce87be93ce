"""Reading and writing the head's configuration file: TOML in, one line of error out, comments kept."""

import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import msgspec
from tomlkit.exceptions import TOMLKitError

from medusa.errors import ConfigError
from medusa.files.configuration import fill, parse, read_text
from medusa.files.replace_file import replace_file
from medusa.machines import DEFAULT_DRIVE, MACHINES, HeadConfig

DEFAULT_FILE = "medusa.toml"


def template(drive: str = DEFAULT_DRIVE) -> str:
    """The commented configuration that `medusa-ctl init` writes, its hazardous keys empty."""
    return MACHINES[drive].template()


def load_config(path: str | Path) -> HeadConfig:
    """Read and check a configuration file; raises ConfigError naming file, key, value and what is allowed."""
    return parse_config(read_text(Path(path)), str(path))


def parse_config(text: str, file: str, *, recorded: bool = True) -> HeadConfig:
    """The configuration in a TOML text; `file` is its name in errors and, if `recorded`, in the result.

    Its key `drive` says for which machine it is; a text without one is for MC3000 boards.
    """
    machine = MACHINES[_drive_of(text, file)]
    config: HeadConfig = parse(text, machine.config, file)  # type: ignore[assignment]
    machine.check(config, file)
    return msgspec.structs.replace(config, file=file) if recorded else config


def _drive_of(text: str, file: str) -> str:
    try:
        drive = tomllib.loads(text).get("drive", DEFAULT_DRIVE)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(file, "", None, f"is not TOML: {error}") from None
    if drive not in MACHINES:
        raise ConfigError(file, "drive", drive, f"one of {', '.join(map(repr, MACHINES))}")
    return str(drive)


def write_keys(path: str | Path, values: Mapping[str, Any]) -> HeadConfig:
    """Change single keys of a configuration file, comments kept; the file changes whole or not at all.

    Raises ConfigError for a key that the file does not hold and for a value that is not allowed.
    """
    path = Path(path)
    try:
        text = fill(read_text(path), values)
    except KeyError as error:
        raise ConfigError(str(path), str(error.args[0]), None, "the file holds no such key") from None
    except TOMLKitError as error:
        raise ConfigError(str(path), "", None, f"is not TOML: {error}") from None
    config = parse_config(text, str(path))
    replace_file(path, text)
    return config
