"""An emulated base behind a pseudo-terminal, in this process: what `--sim` and the tests talk to."""

from __future__ import annotations

from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass
from math import degrees
from typing import TYPE_CHECKING, Any, TypeVar

from labmate.config import BaseConfig, LimitsConfig, SafetyConfig
from labmate.driver.messages import POWER_UP_LIMITS
from labmate.odometry import Pose, WheelGeometry

if TYPE_CHECKING:
    from labmate.base.mobile_base import MobileBase
    from labmate.config import CalibrationFile
    from medusa.link import Trace
    from sim_devices.bench import Bench
    from sim_devices.labmate import BaseMachine

T = TypeVar("T")

SIM_VALUES = {
    "speed_m_s": POWER_UP_LIMITS.speed,
    "turn_rate_deg_s": round(degrees(POWER_UP_LIMITS.turn_rate), 6),
    "acceleration_m_s2": POWER_UP_LIMITS.acceleration,
    "turn_acceleration_deg_s2": round(degrees(POWER_UP_LIMITS.turn_acceleration), 6),
    "watchdog_ms": 500,
}
"""The configuration keys of the emulated base: the limits of a base as delivered."""


def simulated_config() -> BaseConfig:
    """The configuration of the emulated base: what `labmate-drive --sim init` writes."""
    v = SIM_VALUES
    return BaseConfig(
        limits=LimitsConfig(
            speed_m_s=v["speed_m_s"],
            turn_rate_deg_s=v["turn_rate_deg_s"],
            acceleration_m_s2=v["acceleration_m_s2"],
            turn_acceleration_deg_s2=v["turn_acceleration_deg_s2"],
        ),
        safety=SafetyConfig(watchdog_ms=int(v["watchdog_ms"])),
    )


@dataclass(frozen=True)
class SimulatedBase:
    """The emulated base: its port and the configuration for it; `machine` and `bench` only to witness and disturb."""

    port: str
    config: BaseConfig
    machine: BaseMachine
    bench: Bench
    clock: Callable[[], float]
    seed: int | None

    def open(
        self,
        config: BaseConfig | None = None,
        *,
        calibration: CalibrationFile | None = None,
        trace: Trace | None = None,
        poll_period: float = 0.25,
        suspended: Callable[[], float] = lambda: 0.0,
    ) -> AbstractAsyncContextManager[MobileBase]:
        """Connect to it as to a real one; the same seed gives the same bytes."""
        from labmate.machines import open_base

        return open_base(
            self.port,
            config or self.config,
            calibration=calibration,
            trace=trace,
            poll_period=poll_period,
            seed=self.seed,
            name="the simulated base",
            suspended=suspended,
        )

    def true_pose(self) -> Pose:
        """Where the base really is now, out of band."""
        x, y, heading = self.machine.pose(self.clock())
        return Pose(x, y, heading)

    def true_geometry(self) -> WheelGeometry:
        """What the emulated wheels really do."""
        floor = self.machine.config
        return WheelGeometry(floor.wheel_base, floor.diameter_ratio, 50_000)


@asynccontextmanager
async def simulated_base(
    seed: int | None = 0, *, emulated: Any = None, faults: Any = None, baud: int = 115200
) -> AsyncIterator[SimulatedBase]:
    """Start the emulator on the running loop.

    `emulated`: a `sim_devices.labmate.BaseConfig` (floor plan, true wheels, battery), the page's when None;
    `faults`: a `FaultPlan` of the line.
    """
    import asyncio

    from sim_devices.bench import Bench
    from sim_devices.labmate import BaseMachine

    machine = BaseMachine(emulated, seed)
    async with Bench({"base": machine}, seed=seed, baud=baud, faults=faults) as bench:
        yield SimulatedBase(
            bench.ports["labmate"], simulated_config(), machine, bench, asyncio.get_running_loop().time, seed
        )


def run_virtual(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end in virtual time, as asyncio.run does on the wall clock."""
    from sim_devices.clock import run_virtual as run

    return run(main)
