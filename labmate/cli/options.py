"""What every command of labmate-drive shares: the options before it, and the base they lead to."""

from __future__ import annotations

from collections.abc import AsyncIterator, Coroutine
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, TypeVar

from medusa.console import Console

if TYPE_CHECKING:
    from labmate.base.mobile_base import MobileBase
    from labmate.config import BaseConfig, CalibrationFile
    from labmate.simulation import SimulatedBase

T = TypeVar("T")

DEFAULT_FILE = "labmate.toml"


@dataclass(frozen=True, kw_only=True)
class Options(Console):
    """The options before the command."""

    program: ClassVar[str] = "labmate-drive"
    machine: ClassVar[str] = "base"

    port: str | None = None
    config: str | None = None
    calibration: str | None = None

    def run_virtual(self, main: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in virtual time."""
        from labmate.simulation import run_virtual

        return run_virtual(main)

    def base_config(self) -> BaseConfig | None:
        """The configuration that was asked for, or lies here; None when there is none. Raises ConfigError."""
        from labmate.config import read_config

        if self.config is not None:
            return read_config(Path(self.config))
        if not self.sim and Path(DEFAULT_FILE).exists():
            return read_config(Path(DEFAULT_FILE))
        return None

    def config_to_stop_by(self) -> BaseConfig | None:
        """The configuration; a wrong one is reported and passed over where the port is named: no file prevents a stop.

        Raises ConfigError when the port is not named.
        """
        from medusa.errors import ConfigError

        try:
            return self.base_config()
        except ConfigError as error:
            if self.port is None:
                raise
            self.progress(f"{error}; stopping without it")
            return None

    def calibration_file(self) -> CalibrationFile | None:
        """The calibration that was asked for on the command line. Raises ConfigError."""
        from labmate.config import read_calibration

        return None if self.calibration is None else read_calibration(Path(self.calibration))

    def port_of(self, config: BaseConfig | None) -> str:
        """Where the real base hangs; raises CommandError when no port is named."""
        from medusa.errors import CommandError

        port = self.port or (config.port.path if config is not None else None)
        if port is None:
            raise CommandError(
                "no base named: give --port /dev/ttyUSB0 (or port.path in the configuration), or --sim"
            )
        return port

    @asynccontextmanager
    async def base(self, *, to_stop: bool = False) -> AsyncIterator[tuple[MobileBase, SimulatedBase | None]]:
        """The base, emulated or real, connected and at rest; `to_stop` it neither file is needed."""
        from labmate.machines import open_base
        from medusa.errors import CommandError

        if self.sim and self.port is not None:
            raise CommandError("--sim brings its own port: leave --port out")
        config = self.config_to_stop_by() if to_stop else self.base_config()
        calibration = None if to_stop else self.calibration_file()
        port = None if self.sim else self.port_of(config)
        trace = self.open_trace()
        async with AsyncExitStack() as stack:
            if trace is not None:
                stack.callback(trace.close)
            if port is None:
                from labmate.simulation import simulated_base

                simulated = await stack.enter_async_context(simulated_base(self.seed))
                opened = simulated.open(config, calibration=calibration, trace=trace)
                yield await stack.enter_async_context(opened), simulated
            else:
                opened = open_base(port, config, calibration=calibration, trace=trace)
                yield await stack.enter_async_context(opened), None
