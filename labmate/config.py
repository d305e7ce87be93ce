"""The base's configuration and its calibration, as TOML: typed, range-checked, degrees and millimetres in keys.

Nothing hazardous has a default: limits and watchdog are written down by whoever runs the machine.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from math import radians
from pathlib import Path
from typing import Annotated, Any, Literal, TypeVar

import msgspec
from msgspec import Meta

from labmate.calibration import Calibration
from labmate.messages import Limits
from labmate.odometry import OdometryNoise
from medusa.errors import ConfigError
from medusa.files.replace_file import replace_file

T = TypeVar("T")


class PortConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Where the base hangs; the path may be left out and given on the command line."""

    path: str | None = None
    baud: Literal[9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600] = 115200
    address: Annotated[int, Meta(ge=1, le=0x7E)] = 0x10


class LimitsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the base may do; GO and TURN run at these."""

    speed_m_s: Annotated[float, Meta(ge=0.01, le=1.0)]
    turn_rate_deg_s: Annotated[float, Meta(ge=0.5, le=90.0)]
    acceleration_m_s2: Annotated[float, Meta(ge=0.02, le=2.0)]
    turn_acceleration_deg_s2: Annotated[float, Meta(ge=1.0, le=360.0)]


class SafetyConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What stops the base when the host cannot."""

    watchdog_ms: Annotated[int, Meta(ge=200, le=2000)]


class OdometryConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """How far the reckoning is trusted; the last two hold for a base that is not calibrated."""

    wheel_noise_mm: Annotated[float, Meta(ge=0.0, le=100.0)] = 1.0
    wheel_base_deviation_mm: Annotated[float, Meta(ge=0.0, le=100.0)] = 3.0
    wheel_ratio_deviation: Annotated[float, Meta(ge=0.0, le=0.05)] = 0.002

    @property
    def uncalibrated(self) -> OdometryNoise:
        """The noise of a base known only by its data sheet."""
        return OdometryNoise(
            self.wheel_noise, self.wheel_base_deviation_mm * 1e-3, self.wheel_ratio_deviation
        )

    @property
    def wheel_noise(self) -> float:
        """Standard deviation of a wheel's way after one metre, m^½."""
        return self.wheel_noise_mm * 1e-3


class BaseConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A base. `file` is where it was read, None for one made in the program."""

    limits: LimitsConfig
    safety: SafetyConfig
    port: PortConfig = PortConfig()
    odometry: OdometryConfig = OdometryConfig()
    calibration: str | None = None
    file: str | None = None

    @property
    def wire_limits(self) -> Limits:
        """The limits in SI units, as the base takes them."""
        c = self.limits
        return Limits(
            c.speed_m_s,
            radians(c.turn_rate_deg_s),
            c.acceleration_m_s2,
            radians(c.turn_acceleration_deg_s2),
        )

    @property
    def calibration_path(self) -> Path | None:
        """The calibration file; a relative name is looked up beside the configuration."""
        if self.calibration is None:
            return None
        return (Path(self.file).parent if self.file else Path()) / self.calibration


class CalibrationTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What a square calibration found."""

    wheel_base_mm: Annotated[float, Meta(ge=50.0, le=2000.0)]
    wheel_ratio: Annotated[float, Meta(ge=0.9, le=1.1)]
    wheel_base_deviation_mm: Annotated[float, Meta(ge=0.0, le=100.0)]
    wheel_ratio_deviation: Annotated[float, Meta(ge=0.0, le=0.05)]


class NominalTable(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What the base says of itself; a calibration belongs to one base."""

    wheel_base_mm: Annotated[float, Meta(ge=50.0, le=2000.0)]
    counts_per_metre: Annotated[int, Meta(ge=1)]


class CalibrationFile(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """A calibration and the base that it belongs to."""

    calibration: CalibrationTable
    nominal: NominalTable
    file: str = ""

    @property
    def value(self) -> Calibration:
        """The calibration in SI units."""
        c = self.calibration
        return Calibration(
            c.wheel_base_mm * 1e-3, c.wheel_ratio, c.wheel_base_deviation_mm * 1e-3, c.wheel_ratio_deviation
        )

    def check_belongs_to(self, wheel_base: float, counts_per_metre: float) -> None:
        """Raise ConfigError unless the base that answers (m, counts/m) is the calibrated one."""
        if self.nominal.counts_per_metre != counts_per_metre:
            raise ConfigError(
                self.file, "nominal.counts_per_metre", self.nominal.counts_per_metre,
                f"the base says {counts_per_metre:.0f}: this calibration is of another base",
            )  # fmt: skip
        if abs(self.nominal.wheel_base_mm - 1e3 * wheel_base) > 0.05:
            raise ConfigError(
                self.file, "nominal.wheel_base_mm", self.nominal.wheel_base_mm,
                f"the base says {1e3 * wheel_base:.1f}: this calibration is of another base",
            )  # fmt: skip


def read_config(path: Path) -> BaseConfig:
    """Read a configuration; raises ConfigError naming file, key, value and what is allowed."""
    return msgspec.structs.replace(_read(path, BaseConfig), file=str(path))


def read_calibration(path: Path) -> CalibrationFile:
    """Read a calibration; raises ConfigError, also when its lengths are in another unit than millimetres."""
    found = msgspec.structs.replace(_read(path, CalibrationFile), file=str(path))
    measured, nominal = found.calibration.wheel_base_mm, found.nominal.wheel_base_mm
    if not 0.9 <= measured / nominal <= 1.1:
        raise ConfigError(
            str(path), "calibration.wheel_base_mm", measured,
            f"must lie within 10 % of the nominal {nominal} mm; are both in millimetres?",
        )  # fmt: skip
    return found


def write_calibration(
    path: Path, calibration: Calibration, wheel_base: float, counts_per_metre: int, note: str
) -> None:
    """Write a calibration of the base with this nominal wheel base (m); `note` says how it was found."""
    import tomlkit

    document = tomlkit.document()
    for line in note.splitlines():
        document.add(tomlkit.comment(line))
    found = tomlkit.table()
    found.add("wheel_base_mm", round(1e3 * calibration.wheel_base, 4))
    found.add("wheel_ratio", round(calibration.wheel_ratio, 8))
    found.add("wheel_base_deviation_mm", round(1e3 * calibration.wheel_base_deviation, 4))
    found.add("wheel_ratio_deviation", round(calibration.wheel_ratio_deviation, 8))
    nominal = tomlkit.table()
    nominal.add("wheel_base_mm", round(1e3 * wheel_base, 1))
    nominal.add("counts_per_metre", counts_per_metre)
    document.add("calibration", found)
    document.add("nominal", nominal)
    replace_file(path, tomlkit.dumps(document))


def template(filled: Mapping[str, float] | None = None) -> str:
    """The commented configuration that `labmate-drive init` writes; hazardous keys empty unless filled."""
    text = resources.files("labmate").joinpath("templates/base.toml").read_text(encoding="utf-8")
    for key, value in (filled or {}).items():
        text = re.sub(rf'^{key} = ""', f"{key} = {value:g}", text, flags=re.MULTILINE)
    return text


def _read(path: Path, kind: type[T]) -> T:
    import tomllib

    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(str(path), "", None, f"cannot be read: {error.strerror}") from error
    except UnicodeDecodeError as error:
        raise ConfigError(str(path), "", None, "is not UTF-8 text") from error
    except tomllib.TOMLDecodeError as error:
        raise ConfigError(str(path), "", None, f"is not TOML: {error}") from error
    if "file" in raw:
        raise ConfigError(str(path), "file", raw["file"], "is not a key of this file")
    try:
        return msgspec.convert(raw, kind)
    except msgspec.ValidationError as error:
        raise _explained(str(path), raw, kind, str(error)) from None


def _explained(file: str, raw: dict[str, Any], kind: type, text: str) -> ConfigError:
    """Turn msgspec's complaint into file, key, value and allowed range."""
    complaint, _, place = text.partition(" - at `$")
    keys = [key for key in place.rstrip("`").split(".") if key]
    if missing := re.match(r"Object (missing required|contains unknown) field `(\w+)`", complaint):
        keys.append(missing[2])
        if missing[1] == "contains unknown":
            return ConfigError(file, ".".join(keys), _at(raw, keys), "is not a key of this file")
        return ConfigError(file, ".".join(keys), None, f"is missing; {_allowed(kind, keys)}")
    value = _at(raw, keys)
    allowed = _allowed(kind, keys)
    if value == "":
        return ConfigError(file, ".".join(keys), value, f"is not filled in; {allowed}")
    hint = _unit_hint(kind, keys, value)
    return ConfigError(file, ".".join(keys), value, (allowed or complaint) + hint)


def _at(raw: Any, keys: list[str]) -> Any:
    for key in keys:
        raw = raw.get(key) if isinstance(raw, dict) else None
    return raw


def _field_type(kind: type, keys: list[str]) -> msgspec.inspect.Type | None:
    found: msgspec.inspect.Type = msgspec.inspect.type_info(kind)
    for key in keys:
        if not isinstance(found, msgspec.inspect.StructType):
            return None
        field = next((field for field in found.fields if field.name == key), None)
        if field is None:
            return None
        found = field.type
    return found


def _allowed(kind: type, keys: list[str]) -> str:
    found = _field_type(kind, keys)
    if isinstance(found, msgspec.inspect.LiteralType):
        return "must be one of " + ", ".join(str(value) for value in found.values)
    if isinstance(found, msgspec.inspect.FloatType | msgspec.inspect.IntType):
        noun = "a number" if isinstance(found, msgspec.inspect.FloatType) else "a whole number"
        low = "" if found.ge is None else f" from {found.ge}"
        high = "" if found.le is None else f" to {found.le}"
        return f"must be {noun}{low}{high}"
    if isinstance(found, msgspec.inspect.StructType):
        return "must be a table"
    return "must be text"


def _unit_hint(kind: type, keys: list[str], value: object) -> str:
    """Say so when the value would fit after a change of unit that people commonly miss."""
    found = _field_type(kind, keys)
    if not isinstance(found, msgspec.inspect.FloatType) or found.ge is None or found.le is None:
        return ""
    if not isinstance(value, int | float) or isinstance(value, bool):
        return ""
    units = (("metres", "millimetres", 1e3),) if keys[-1].endswith("_mm") else ()
    if keys[-1].endswith(("_m_s", "_m_s2")):
        units = (("millimetres", "metres", 1e-3),)
    for wrong, right, factor in units:
        if found.ge <= value * factor <= found.le:
            return f"; {value} looks like {wrong}, the key is in {right}"
    return ""
