"""Which machines there are: a configuration's drive, opened as a joint group."""

from contextlib import AbstractAsyncContextManager
from typing import Literal

from medusa.head.joint_group import JointGroup
from medusa.link import Trace
from medusa.mc3000.config import HeadConfig
from medusa.mc3000.drive import Mc3000Drive


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
    drive = Mc3000Drive(config, boards, amps, trace=trace, port_name=port_name, seed=seed)
    return JointGroup.open(drive)
