"""What stands on the bench, from its TOML file: `baud`, `[head]`, `[world]`, `[[base]]`, `plan`, `[[camera]]`.

Everything is optional.
"""

from pathlib import Path
from typing import Annotated

import msgspec

from sim_devices.bench import Part
from sim_devices.carried import carried_camera, motion_of
from sim_devices.config import ConfigError, convert, read_toml
from sim_devices.head import AMPLIFIER_LINE, BOARD_LINE, HeadConfig, HeadMachine
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.obstacles import between_walls
from sim_devices.plan_base import world_of_bases
from sim_devices.rendered import RenderedWorld
from sim_devices.stereo import SIDES, StereoWorld
from sim_devices.worlds.config import CarriedCameraConfig, WorldConfig
from sim_devices.worlds.placement import Motion, mounted
from sim_devices.worlds.plan import Mount
from sim_devices.worlds.plan_files import read_plan
from sim_devices.worlds.walls import WORLD, carrier_of


class BenchConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The bench's file: without one, a head and a base as their pages describe them.

    `head = false` leaves the head out (and its world), `base = []` the base, `world = false` the head's
    cameras. With a `plan` (a name or a file) the bases drive between its walls; `[[camera]]` are cameras on
    them. In a plan the head sees when `[head_on]` says where it stands.
    """

    baud: Annotated[int, msgspec.Meta(ge=300, le=4_000_000)] = 115200
    head: HeadConfig | bool = True
    world: WorldConfig | bool = True
    base: list[BaseConfig] = msgspec.field(default_factory=lambda: [BaseConfig()])
    plan: str = ""
    camera: list[CarriedCameraConfig] = []
    head_on: Mount | None = None

    @property
    def head_sees(self) -> bool:
        """Whether the head has its cameras."""
        return bool(self.head and self.world and (self.head_on is not None or not self.plan))

    @property
    def base_names(self) -> list[str]:
        """What the bases are called: "base", "base2", …"""
        return ["base" if n == 0 else f"base{n + 1}" for n in range(len(self.base))]


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
    if config.plan.endswith(".toml"):
        config = msgspec.structs.replace(config, plan=str(path.parent / config.plan))
    _check_mounts(path, config)
    return config


def _check_mounts(path: Path, config: BenchConfig) -> None:
    mounts = {f"camera[{n}].mount": camera.mount for n, camera in enumerate(config.camera)}
    if config.head_on is not None:
        mounts["head_on"] = config.head_on
    if config.plan:
        try:
            panels = read_plan(config.plan).panel
        except ConfigError as error:
            raise ConfigError(f"{path}: plan: {error}") from None
        mounts |= {f"plan's panel[{n}].mount": panel.mount for n, panel in enumerate(panels)}
    names = [WORLD, *config.base_names]
    for key, mount in mounts.items():
        if mount.on not in names:
            raise ConfigError(f"{path}: {key}.on = {mount.on!r}: must be one of {', '.join(names)}")
    if config.camera and not (config.plan or config.head_sees):
        raise ConfigError(f"{path}: camera: nothing to see; give a plan, or a head with its world")
    cameras: list[str] = [*(SIDES if config.head_sees else ())]
    for n, camera in enumerate(config.camera):
        if camera.name in cameras:
            raise ConfigError(f"{path}: camera[{n}].name = {camera.name!r}: taken; choose another")
        cameras.append(camera.name)


def build_parts(config: BenchConfig, seed: int | None) -> dict[str, Part]:
    """Build the machines: "head", "world" (what cameras see), "base", "base2", …"""
    plan = read_plan(config.plan) if config.plan else None
    bases = {
        name: BaseMachine(base if plan is None else between_walls(base, plan), seed)
        for name, base in zip(config.base_names, config.base, strict=True)
    }
    carriers = {name: motion_of(machine) for name, machine in bases.items()}
    world = None if plan is None else world_of_bases(plan, bases, seed=seed or 0)
    rendered = None if world is None else RenderedWorld(world)
    parts: dict[str, Part] = {}
    if config.head:
        head = HeadMachine(HeadConfig() if config.head is True else config.head, seed)
        parts["head"] = head
        if config.head_sees:
            seen = config.world if isinstance(config.world, WorldConfig) else WorldConfig()
            stand = _stand(config.head_on, carriers)
            rendered = StereoWorld(seen, head.joint_angles, seed=seed or 0, stand=stand, world=world)
    if rendered is not None:
        for camera in config.camera:
            rendered.mount(carried_camera(camera, rendered.world, carriers, seed=seed or 0), camera.port)
        parts["world"] = rendered
    return parts | bases


def _stand(mount: Mount | None, carriers: dict[str, Motion]) -> Motion | None:
    if mount is None:
        return None
    return mounted(carrier_of(mount.on, carriers, "head_on.on"), mount.placement())
