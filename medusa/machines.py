"""Which machines there are: a row for each drive that a configuration can name."""

from collections.abc import Callable, Mapping
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from typing import Any, Literal

import msgspec

from medusa.errors import CommandError
from medusa.head.drive import Drive
from medusa.head.joint_group import JointGroup
from medusa.ideal import config as ideal
from medusa.ideal.drive import IdealDrive
from medusa.link import Trace
from medusa.mc3000 import config as mc3000
from medusa.mc3000.config_limits import check_limits
from medusa.mc3000.drive import Mc3000Drive

HeadConfig = mc3000.Mc3000Config | ideal.IdealConfig
"""A head's configuration: a union, distinguished by the key `drive`."""
DEFAULT_DRIVE = "mc3000"
"""What a configuration without the key `drive` is for."""


@dataclass(frozen=True)
class Ports:
    """Where a head is connected, as the command line gives it; the configuration's own paths when None."""

    boards: str | None = None
    amplifiers: str | Literal[False] | None = None


@dataclass(frozen=True)
class Machine:
    """How heads with one drive are configured and opened."""

    config: type[msgspec.Struct]
    check: Callable[[Any, str], None]
    template: Callable[[], str]
    make_drive: Callable[..., Drive]


def _make_mc3000(config: mc3000.Mc3000Config, ports: Ports, **more: Any) -> Drive:
    return Mc3000Drive(config, ports.boards, ports.amplifiers, **more)


def _make_ideal(config: ideal.IdealConfig, ports: Ports, **more: Any) -> Drive:
    if ports.boards or ports.amplifiers:
        raise CommandError("an ideal head has no ports: leave --boards and --amps out")
    return IdealDrive(config.traits, watchdog=config.watchdog_ms / 1000)


MACHINES: Mapping[str, Machine] = {
    "mc3000": Machine(mc3000.Mc3000Config, check_limits, mc3000.template, _make_mc3000),
    "ideal": Machine(ideal.IdealConfig, ideal.check_limits, ideal.template, _make_ideal),
}


def open_head(
    config: HeadConfig,
    boards: str | None = None,
    amps: str | Literal[False] | None = None,
    *,
    trace: Trace | None = None,
    port_name: str | None = None,
    seed: int | None = None,
) -> AbstractAsyncContextManager[JointGroup]:
    """Connect to a head and leave it stopped and disabled at the end.

    Paths not given are the configuration's; without any for the amplifiers, or with False, the head can be read and
    stopped, not enabled. Raises PortError and what the link raises; at the end DeviceFault when the head cannot be
    confirmed at rest.
    """
    machine = MACHINES[str(config.__struct_config__.tag)]
    drive = machine.make_drive(config, Ports(boards, amps), trace=trace, port_name=port_name, seed=seed)
    return JointGroup.open(drive)
