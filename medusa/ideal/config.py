"""The configuration of an ideal head: joints by name with what they may do, degrees in the keys."""

import math
from collections.abc import Iterator
from importlib import resources
from typing import Annotated

import msgspec
from msgspec import Meta

from medusa.errors import ConfigError
from medusa.head.drive import JointTraits

Degrees = Annotated[float, Meta(ge=-180.0, le=180.0)]

RESOLUTION = math.radians(1e-4)
"""Of a reading, rad: finer than any encoder's."""
SETTLE = math.radians(0.01)


class IdealJointConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One joint."""

    soft_min_deg: Degrees
    soft_max_deg: Degrees
    max_speed_deg_s: Annotated[float, Meta(gt=0.0, le=1000.0)]
    acceleration_deg_s2: Annotated[float, Meta(gt=0.0, le=20000.0)]
    park_deg: Degrees

    @property
    def traits(self) -> JointTraits:
        """The same in SI."""
        return JointTraits(
            low=math.radians(self.soft_min_deg),
            high=math.radians(self.soft_max_deg),
            speed=math.radians(self.max_speed_deg_s),
            acceleration=math.radians(self.acceleration_deg_s2),
            resolution=RESOLUTION,
            rate_step=RESOLUTION,
            settle=SETTLE,
            largest_step=math.inf,
            park=math.radians(self.park_deg),
        )


class IdealConfig(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="drive", tag="ideal"
):
    """A head that follows its commands exactly; `file` is where it was read, None for one made in the program."""

    watchdog_ms: Annotated[int, Meta(ge=50, le=5000)]
    axes: dict[str, IdealJointConfig]
    file: str | None = None

    @property
    def traits(self) -> dict[str, JointTraits]:
        """By joint what it may do."""
        return {name: axis.traits for name, axis in self.axes.items()}


def template() -> str:
    """A commented configuration of an ideal head with the joints and limits of the emulated one."""
    return resources.files("medusa.ideal").joinpath("head.toml").read_text(encoding="utf-8")


def check_limits(config: IdealConfig, file: str) -> None:
    """Raise ConfigError for the first key that does not go with the others."""
    for key, value, allowed in _wrong(config):
        raise ConfigError(file, key, value, allowed)


def _wrong(config: IdealConfig) -> Iterator[tuple[str, object, str]]:
    if not config.axes:
        yield "axes", {}, "at least one table [axes.NAME]"
    for name, axis in config.axes.items():
        if axis.soft_min_deg >= axis.soft_max_deg:
            yield (
                f"axes.{name}.soft_min_deg",
                axis.soft_min_deg,
                f"less than soft_max_deg, {axis.soft_max_deg:g}",
            )
        if not axis.soft_min_deg <= axis.park_deg <= axis.soft_max_deg:
            allowed = f"between the soft limits, {axis.soft_min_deg:g} to {axis.soft_max_deg:g}"
            yield f"axes.{name}.park_deg", axis.park_deg, allowed
