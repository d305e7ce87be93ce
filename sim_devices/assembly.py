"""What stands on the bench, from its TOML file: `baud`, `[head]`, `[world]`, `[[base]]`. Everything is optional."""

from pathlib import Path
from typing import Annotated

import msgspec

from sim_devices.bench import Part
from sim_devices.config import ConfigError, convert, read_toml
from sim_devices.head import AMPLIFIER_LINE, BOARD_LINE, HeadConfig, HeadMachine
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.stereo import StereoWorld
from sim_devices.worlds.config import WorldConfig


class BenchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The bench's file: without one, a head and a base as their pages describe them.

    `head = false` leaves the head out (and its world), `base = []` the base, `world = false` the cameras.
    """

    baud: Annotated[int, msgspec.Meta(ge=300, le=4_000_000)] = 115200
    head: HeadConfig | bool = True
    world: WorldConfig | bool = True
    base: list[BaseConfig] = msgspec.field(default_factory=lambda: [BaseConfig()])


def read_bench(path: Path | None) -> BenchConfig:
    """Read the bench's file; raises ConfigError of one line. None gives the defaults."""
    if path is None:
        return BenchConfig()
    config = convert(path, read_toml(path), BenchConfig)
    taken = set()
    for n, base in enumerate(config.base):
        if config.head and base.line in (BOARD_LINE, AMPLIFIER_LINE):
            raise ConfigError(f"{path}: base[{n}].line = {base.line!r}: is the head's; choose another name")
        if (base.line, base.address) in taken:
            raise ConfigError(
                f"{path}: base[{n}].address = {base.address}: taken on line {base.line!r} already; "
                "choose another from 1 to 126"
            )
        taken.add((base.line, base.address))
    return config


def build_parts(config: BenchConfig, seed: int | None) -> dict[str, Part]:
    """Build the machines: "head", "world" (what the head sees), "base", "base2", …"""
    parts: dict[str, Part] = {}
    if config.head:
        head = HeadMachine(HeadConfig() if config.head is True else config.head, seed)
        parts["head"] = head
        if config.world:
            world = WorldConfig() if config.world is True else config.world
            parts["world"] = StereoWorld(world, head.joint_angles, seed=seed or 0)
    for n, base in enumerate(config.base, start=1):
        parts["base" if n == 1 else f"base{n}"] = BaseMachine(base, seed)
    return parts
