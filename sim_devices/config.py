"""TOML files of the bench, range-checked: what stands on it, and what shall go wrong there."""

import re
import tomllib
from pathlib import Path
from typing import Annotated, Any, TypeVar

import msgspec

from sim_devices.link.faults import FaultPlan

T = TypeVar("T")


class ConfigError(Exception):
    """A mistake in a file: which file, key and value, and what is allowed."""


class Incident(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """Something to inject at a time after the start: a verb of `sim-devices inject` and its arguments."""

    time_s: Annotated[float, msgspec.Meta(ge=0)]
    verb: str
    arguments: dict[str, str | float | bool] = {}


class Faults(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """`[line.NAME]`: what the wire of a line does; `[[at]]`: what to inject and when."""

    line: dict[str, FaultPlan] = {}
    at: list[Incident] = []


def read_faults(path: Path) -> Faults:
    """Read a faults file; raises ConfigError of one line."""
    data = read_toml(path)
    plans = data.pop("line", {})
    if not isinstance(plans, dict):
        raise ConfigError(f"{path}: line = {plans!r}: expected tables [line.NAME]")
    faults = convert(path, data, Faults)
    lines = {name: convert(path, plan, FaultPlan, f"line.{name}") for name, plan in plans.items()}
    return Faults(lines, faults.at)


def read_toml(path: Path) -> dict[str, Any]:
    """Read a TOML file; raises ConfigError of one line."""
    try:
        return tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except UnicodeDecodeError:
        raise ConfigError(f"{path}: is not UTF-8 text") from None
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(f"{path}: {error}") from None


def convert(path: Path, data: Any, kind: type[T], prefix: str = "") -> T:
    """Convert a table of the file; raises ConfigError with file, key, value and what is allowed."""
    try:
        return msgspec.convert(data, kind)
    except msgspec.ValidationError as error:
        message, _, place = str(error).partition(" - at ")
        inside = place.strip("`").removeprefix("$").removeprefix(".")
        key = ".".join(part for part in (prefix, inside) if part)
        value = _value_at(data, inside)
        shown = key if isinstance(value, dict | list) or value is _MISSING else f"{key} = {value!r}"
        if not inside and "unknown field" in message:
            message += f"; there are {', '.join(getattr(kind, '__struct_fields__', ()))}"
        text = message[:1].lower() + message[1:]
        raise ConfigError(f"{path}: {shown}: {text}" if shown else f"{path}: {text}") from None


_MISSING = object()


def _value_at(data: Any, key: str) -> Any:
    for name, index in re.findall(r"([^.\[\]]+)|\[(\d+)\]", key):
        try:
            data = data[int(index)] if index else data[name]
        except (KeyError, IndexError, TypeError):
            return _MISSING
    return data
