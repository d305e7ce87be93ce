"""Reading and writing the head's configuration file: TOML in, one line of error out, comments kept."""

from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any

import msgspec
from tomlkit.exceptions import TOMLKitError

from medusa.errors import ConfigError
from medusa.files.configuration import fill, parse, read_text
from medusa.files.replace_file import replace_file
from medusa.mc3000.config import HeadConfig
from medusa.mc3000.config_limits import check_limits

DEFAULT_FILE = "medusa.toml"


def template() -> str:
    """The commented configuration that `medusa-ctl init` writes, its hazardous keys empty."""
    return resources.files("medusa.mc3000").joinpath("head.toml").read_text(encoding="utf-8")


def load_config(path: str | Path) -> HeadConfig:
    """Read and check a configuration file; raises ConfigError naming file, key, value and what is allowed."""
    return parse_config(read_text(Path(path)), str(path))


def parse_config(text: str, file: str, *, recorded: bool = True) -> HeadConfig:
    """The configuration in a TOML text; `file` is its name in errors and, if `recorded`, in the result."""
    config = parse(text, HeadConfig, file)
    check_limits(config, file)
    return msgspec.structs.replace(config, file=file) if recorded else config


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
