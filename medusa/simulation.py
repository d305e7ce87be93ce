"""An emulated head behind pseudo-terminals, in this process: what `--sim` and the tests talk to."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from medusa.config import HeadConfig
from medusa.config_simulated import simulated_config

if TYPE_CHECKING:
    from medusa.head import Head
    from medusa.link import Trace
    from sim_devices.bench import Bench
    from sim_devices.head import HeadMachine

PORT_NAME = "simulated"
"""Stands for the port in the homing marks: a pseudo-terminal's path differs from run to run."""


@dataclass(frozen=True)
class SimulatedHead:
    """The emulated head: its ports and the configuration for them; `machine` and `bench` only as witness."""

    boards: str
    amps: str
    config: HeadConfig
    machine: HeadMachine
    bench: Bench
    seed: int | None

    def open(
        self, config: HeadConfig | None = None, trace: Trace | None = None
    ) -> AbstractAsyncContextManager[Head]:
        """Connect to it as to a real one; the same seed gives the same bytes."""
        from medusa.head import Head

        return Head.open(
            config or self.config, self.boards, self.amps, trace, port_name=PORT_NAME, seed=self.seed
        )


@asynccontextmanager
async def simulated_head(
    seed: int | None = 0, config: Any = None, faults: Any = None, *, baud: int = 115200
) -> AsyncIterator[SimulatedHead]:
    """Start the emulators on the running loop.

    `config`: a `sim_devices.head_config.HeadConfig` (friction, backlash, bus voltage …), the pages' values when None;
    `faults`: a `FaultPlan` for both lines, or one for each of "mc3000" and "servo-amps".
    """
    from sim_devices.bench import Bench
    from sim_devices.head import HeadMachine

    machine = HeadMachine(config, seed)
    async with Bench({"head": machine}, seed=seed, baud=baud, faults=faults) as bench:
        yield SimulatedHead(
            bench.ports["mc3000"], bench.ports["servo-amps"], simulated_config(), machine, bench, seed
        )
