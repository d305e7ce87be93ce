"""The base's configuration and its calibration, as TOML: typed, range-checked, degrees and millimetres in keys.

Nothing hazardous has a default: limits and watchdog are written down by whoever runs the machine.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from importlib import resources
from math import radians
from pathlib import Path
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from labmate.base.driver import Limits
from labmate.calibration import Calibration
from labmate.odometry import OdometryNoise
from medusa.errors import ConfigError
from medusa.files.configuration import parse, read_text
from medusa.files.replace_file import replace_file

Machine = Literal["labmate"]
"""Which base a configuration is for: a row of `labmate.machines`."""


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
    """Uncertainty of the reckoning; the last two hold for a base that is not calibrated."""

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
    machine: Machine = "labmate"
    port: PortConfig = PortConfig()
    odometry: OdometryConfig = OdometryConfig()
    calibration: str | None = None
    file: str | None = None

    @property
    def motion_limits(self) -> Limits:
        """The limits in SI units."""
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
    """What the base reports of itself; a calibration belongs to one base."""

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
                f"the base reports {counts_per_metre:.0f}: this calibration is of another base",
            )  # fmt: skip
        if abs(self.nominal.wheel_base_mm - 1e3 * wheel_base) > 0.05:
            raise ConfigError(
                self.file, "nominal.wheel_base_mm", self.nominal.wheel_base_mm,
                f"the base reports {1e3 * wheel_base:.1f}: this calibration is of another base",
            )  # fmt: skip


def read_config(path: Path) -> BaseConfig:
    """Read a configuration; raises ConfigError naming file, key, value and what is allowed."""
    return msgspec.structs.replace(parse(read_text(path), BaseConfig, str(path)), file=str(path))


def read_calibration(path: Path) -> CalibrationFile:
    """Read a calibration; raises ConfigError, also when its lengths are in another unit than millimetres."""
    found = msgspec.structs.replace(parse(read_text(path), CalibrationFile, str(path)), file=str(path))
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
