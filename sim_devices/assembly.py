"""What stands on the bench, from its TOML file: `[head]`, `[[base]]`, baud. Everything is optional."""

from pathlib import Path
from typing import Annotated

import msgspec

from sim_devices.bench import Part
from sim_devices.config import ConfigError, convert, read_toml
from sim_devices.labmate import BaseConfig, BaseMachine


class BenchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The bench's file: without one, a base at address 10H on line "labmate"."""

    baud: Annotated[int, msgspec.Meta(ge=300, le=4_000_000)] = 115200
    base: list[BaseConfig] = msgspec.field(default_factory=lambda: [BaseConfig()])


def read_bench(path: Path | None) -> BenchConfig:
    """Read the bench's file; raises ConfigError of one line. None gives the defaults."""
    if path is None:
        return BenchConfig()
    config = convert(path, read_toml(path), BenchConfig)
    taken = set()
    for n, base in enumerate(config.base):
        if (base.line, base.address) in taken:
            raise ConfigError(
                f"{path}: base[{n}].address = {base.address}: taken on line {base.line!r} already; "
                "choose another from 1 to 126"
            )
        taken.add((base.line, base.address))
    return config


def build_parts(config: BenchConfig, seed: int | None) -> dict[str, Part]:
    """Build the machines: "base", "base2", …"""
    parts: dict[str, Part] = {}
    for n, base in enumerate(config.base, start=1):
        parts["base" if n == 1 else f"base{n}"] = BaseMachine(base, seed)
    return parts
