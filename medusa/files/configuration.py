"""Reading TOML configurations into typed structs, with one line of error: file, key, value and what is allowed."""

import re
import tomllib
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import tomlkit
from msgspec import inspect

from medusa.errors import ConfigError

T = TypeVar("T")

_WHERE = re.compile(r"^(?P<what>.*?)(?: - at `\$\.?(?P<path>[^`]*)`)?$")
_FIELD = re.compile(r"(required|unknown) field `([^`]*)`")
_UNITS = {
    "_mm": ("metres", "millimetres", 1e3),
    "_m_s": ("millimetres", "metres", 1e-3),
    "_m_s2": ("millimetres", "metres", 1e-3),
}
"""Units that people commonly miss, by the end of the key: what was given, what is asked for, the factor."""


def read_text(path: Path) -> str:
    """The text of a configuration file; raises ConfigError."""
    try:
        return path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        reason = f"cannot be read: {error.strerror}" if isinstance(error, OSError) else "is not UTF-8 text"
        raise ConfigError(str(path), "", None, reason) from None


def parse(text: str, kind: type[T], file: str) -> T:
    """The struct `kind` that a TOML text holds; `file` is its name in errors, and no key of it. Raises ConfigError."""
    try:
        raw = tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(file, "", None, f"is not TOML: {error}") from None
    if "file" in raw:
        raise ConfigError(file, "file", raw["file"], "no such key is known")
    empty = next(iter(_empty_keys(raw)), None)
    if empty is not None:
        raise ConfigError(file, empty, "", f"has to be filled in: {_allowed(kind, empty)}")
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise _explained(str(error), raw, kind, file) from None


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


def _empty_keys(table: Mapping[str, Any], prefix: str = "") -> list[str]:
    keys: list[str] = []
    for key, value in table.items():
        if isinstance(value, Mapping):
            keys += _empty_keys(value, f"{prefix}{key}.")
        elif value == "":
            keys.append(prefix + key)
    return keys


def _explained(message: str, raw: Mapping[str, Any], kind: type, file: str) -> ConfigError:
    """What msgspec found wrong, in the words of the user's file."""
    found = _WHERE.match(message)
    what, path = (found["what"], found["path"] or "") if found else (message, "")
    path = _with_names(path, raw, kind)
    field = _FIELD.search(what)
    if field:
        key = f"{path}.{field[2]}" if path else field[2]
        if field[1] == "required":
            return ConfigError(file, "", None, f"{key} is missing: {_allowed(kind, key)}")
        return ConfigError(file, key, _value(raw, key), "no such key is known")
    value = _value(raw, path)
    return ConfigError(file, path, value, _allowed(kind, path) + _unit_hint(kind, path, value))


def _with_names(path: str, raw: Mapping[str, Any], kind: type) -> str:
    """The path with the names of tables that msgspec writes as [...]: of those named freely, the first wrong one."""
    before, tables, after = path.partition("[...]")
    found = _type_at(kind, before)
    if (
        not tables
        or not isinstance(found, inspect.DictType)
        or not isinstance(found.value_type, inspect.StructType)
    ):
        return path
    for name, table in _value(raw, before).items():
        try:
            msgspec.convert(table, found.value_type.cls)
        except msgspec.ValidationError:
            return f"{before}.{name}{after}"
    return path


def _parts(path: str) -> list[str]:
    """The keys and indices of a path such as homing.order[0][1]."""
    return re.findall(r"[^.\[\]]+", path)


def _value(raw: Mapping[str, Any], path: str) -> Any:
    value: Any = raw
    for part in _parts(path):
        if isinstance(value, Mapping):
            value = value.get(part)
        elif isinstance(value, list) and part.isdigit():
            value = value[int(part)]
    return value


def _type_at(kind: type, path: str) -> inspect.Type | None:
    found: inspect.Type | None = inspect.type_info(kind)
    for part in _parts(path):
        if isinstance(found, inspect.StructType):
            found = next((field.type for field in found.fields if field.name == part), None)
        elif isinstance(found, inspect.DictType):
            found = found.value_type
        elif isinstance(found, inspect.CollectionType):
            found = found.item_type
        else:
            return None
    return found


def _allowed(kind: type, path: str) -> str:
    """What a key takes, in words, from its type and range."""
    found = _type_at(kind, path)
    if isinstance(found, inspect.UnionType):
        # A key that may be left out: what it takes when it is there.
        found = next(t for t in found.types if not isinstance(t, inspect.NoneType))
    match found:
        case inspect.IntType():
            return "an integer" + _range(found)
        case inspect.FloatType():
            return "a number" + _range(found)
        case inspect.StrType():
            return "a text"
        case inspect.LiteralType():
            return "one of " + ", ".join(repr(choice) for choice in found.values)
        case inspect.CollectionType():
            return "a list"
    return "a table"


def _range(found: inspect.IntType | inspect.FloatType) -> str:
    low = "" if found.gt is None else f" from more than {found.gt:g}"
    low = low if found.ge is None else f" from {found.ge:g}"
    return low + ("" if found.le is None else f" to {found.le:g}")


def _unit_hint(kind: type, path: str, value: object) -> str:
    """A value that would fit after a change of unit is pointed out."""
    found = _type_at(kind, path)
    if not isinstance(found, inspect.FloatType) or found.ge is None or found.le is None:
        return ""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return ""
    for end, (wrong, right, factor) in _UNITS.items():
        if path.endswith(end) and found.ge <= value * factor <= found.le:
            return f"; {value} looks like {wrong}, the key is in {right}"
    return ""
