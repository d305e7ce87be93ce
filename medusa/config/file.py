"""Reading and writing the head's configuration file: TOML in, one line of error out, comments kept."""

import re
import tomllib
from collections.abc import Mapping
from importlib import resources
from pathlib import Path
from typing import Any, get_args, get_type_hints

import msgspec
import tomlkit
from tomlkit.exceptions import TOMLKitError

from medusa.errors import ConfigError
from medusa.mc3000.config import HeadConfig
from medusa.mc3000.config_limits import check_limits
from medusa.files.replace_file import replace_file

DEFAULT_FILE = "medusa.toml"


def template() -> str:
    """The commented configuration that `medusa-ctl init` writes, its hazardous keys empty."""
    return resources.files("medusa.mc3000").joinpath("head.toml").read_text(encoding="utf-8")


def load_config(path: str | Path) -> HeadConfig:
    """Read and check a configuration file; raises ConfigError naming file, key, value and what is allowed."""
    try:
        text = Path(path).read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = error.strerror if isinstance(error, OSError) else "is not UTF-8 text"
        raise ConfigError(str(path), "", None, f"cannot be read: {reason}") from None
    return parse_config(text, str(path))


def parse_config(text: str, file: str, *, recorded: bool = True) -> HeadConfig:
    """The configuration in a TOML text; `file` stands in errors and, if `recorded`, in the result."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(file, "", None, f"is not TOML: {error}") from None
    raw.pop("file", None)
    empty = next(iter(_empty_keys(raw)), None)
    if empty is not None:
        raise ConfigError(file, empty, "", f"has to be filled in: {_allowed(empty)}")
    try:
        config = msgspec.convert(raw, HeadConfig)
    except msgspec.ValidationError as error:
        raise _explain(file, raw, str(error)) from None
    check_limits(config, file)
    return msgspec.structs.replace(config, file=file) if recorded else config


def _empty_keys(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    keys: list[str] = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            keys += _empty_keys(value, f"{prefix}{key}.")
        elif value == "":
            keys.append(prefix + key)
    return keys


_WHERE = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<path>[^`]*)`)?$")
_FIELD = re.compile(r"(required|unknown) field `([^`]*)`")


def _explain(file: str, raw: Mapping[str, Any], message: str) -> ConfigError:
    found = _WHERE.match(message)
    what, path = (found["what"], found["path"] or "") if found else (message, "")
    field = _FIELD.search(what)
    if field:
        key = f"{path}.{field[2]}" if path else field[2]
        if field[1] == "required":
            return ConfigError(file, "", None, f"{key} is missing: {_allowed(key)}")
        return ConfigError(file, key, _value(raw, key), "no such key is known")
    return ConfigError(file, path, _value(raw, path), _allowed(path))


def _value(raw: Mapping[str, Any], path: str) -> Any:
    value: Any = raw
    for part in re.findall(r"[^.\[\]]+", path):
        if isinstance(value, Mapping):
            value = value.get(part)
        elif isinstance(value, list) and part.isdigit():
            value = value[int(part)]
    return value


def _allowed(path: str) -> str:
    """What a key takes, in words, from its type and range."""
    kind: Any = HeadConfig
    for part in path.split("."):
        name = part.split("[")[0]
        hints = get_type_hints(kind, include_extras=True) if isinstance(kind, type) else {}
        if name not in hints:
            return "a table" if isinstance(kind, type) else "a list of groups of joints"
        kind = hints[name]
    return _describe(kind)


def _describe(kind: Any) -> str:
    arguments = get_args(kind)
    if not arguments:
        return {int: "an integer", float: "a number", str: "a text"}.get(kind, "a table")
    if hasattr(kind, "__metadata__"):
        (meta,) = kind.__metadata__
        low = f"{meta.ge:g}" if meta.ge is not None else f"more than {meta.gt:g}"
        return f"{_describe(kind.__origin__)} from {low} to {meta.le:g}"
    if type(None) in arguments:
        return "a text"
    if isinstance(arguments[0], int | str):
        return "one of " + ", ".join(repr(choice) for choice in arguments)
    return "a list of groups of joints"


def fill(text: str, values: Mapping[str, Any]) -> str:
    """Set dotted keys in a TOML text and keep its comments; KeyError for a key that it does not hold."""
    document = tomlkit.parse(text)
    for key, value in values.items():
        *tables, last = key.split(".")
        table: Any = document
        for part in tables:
            table = table[part]
        if last not in table:
            raise KeyError(key)
        table[last] = value
    return tomlkit.dumps(document)


def write_keys(path: str | Path, values: Mapping[str, Any]) -> HeadConfig:
    """Change single keys of a configuration file, comments kept; the file changes whole or not at all.

    Raises ConfigError for a key that the file does not hold and for a value that is not allowed.
    """
    path = Path(path)
    try:
        text = fill(path.read_text(encoding="utf-8"), values)
    except KeyError as error:
        raise ConfigError(str(path), str(error.args[0]), None, "the file holds no such key") from None
    except (OSError, UnicodeDecodeError, TOMLKitError) as error:
        raise ConfigError(str(path), "", None, f"cannot be read: {error}") from None
    config = parse_config(text, str(path))
    replace_file(path, text)
    return config
