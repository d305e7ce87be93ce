"""What every command shares: the options before it, the base they lead to, and how a command ends."""

from __future__ import annotations

import asyncio
import contextlib
import json as json_module
import logging
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from labmate.base import Base
    from labmate.config import BaseConfig, CalibrationFile
    from labmate.simulation import SimulatedBase
    from medusa.link import Trace

T = TypeVar("T")

DEFAULT_FILE = "labmate.toml"

_FLAGS = frozenset({"--sim", "--json", "--realtime", "--verbose"})
_VALUES = frozenset({"--port", "--config", "--calibration", "--trace", "--seed"})
_USAGE = 2
_CONFIGURATION = 3
_PORT = 4
_NO_ANSWER = 5
_FAULT = 6


def globals_first(arguments: Sequence[str]) -> list[str]:
    """The arguments with the options of every command moved before the command, wherever they were typed."""
    front: list[str] = []
    rest: list[str] = []
    pending = list(arguments)
    while pending:
        word = pending.pop(0)
        name, equals, _ = word.partition("=")
        if word == "--":
            rest += [word, *pending]
            break
        if name in _VALUES:
            front.append(word)
            if not equals and pending:
                front.append(pending.pop(0))
        elif word in _FLAGS:
            front.append(word)
        else:
            rest.append(word)
    return front + rest


@dataclass(frozen=True)
class Options:
    """The options before the command."""

    sim: bool = False
    port: str | None = None
    config: str | None = None
    calibration: str | None = None
    json: bool = False
    trace: str | None = None
    seed: int = 0
    realtime: bool = False
    verbose: bool = False

    def run(self, body: Callable[[], Coroutine[Any, Any, T]], *, live: bool = False) -> T:
        """Run a command's coroutine on the right clock; an expected error becomes one line and an exit code.

        SIGINT, SIGTERM and SIGHUP cancel it, so that the base is stopped and the stop confirmed on the way out.
        """
        logging.basicConfig(
            level=logging.INFO if self.verbose else logging.ERROR,
            format="%(levelname)s %(message)s",
            stream=sys.stderr,
        )
        from medusa.errors import MedusaError

        caught: list[signal.Signals] = []
        try:
            if self.sim and not (self.realtime or live):
                from labmate.simulation import run_virtual

                return run_virtual(_cancelled_by_signals(body, caught))
            return asyncio.run(_cancelled_by_signals(body, caught))
        except (asyncio.CancelledError, KeyboardInterrupt):
            number = caught[0] if caught else signal.SIGINT
            self.fail(f"stopped by {number.name}; the base stands", 128 + number)
        except MedusaError as error:
            notes = "".join(f"; {note}" for note in getattr(error, "__notes__", ()))
            self.fail(str(error) + notes, exit_code(error))
        except OSError as error:
            self.fail(f"{error.filename or 'i/o'}: {error.strerror or error}", _PORT)

    def fail(self, message: str, code: int = _USAGE) -> NoReturn:
        """One line on stderr (and the JSON document, where one is due), and the end."""
        if self.json:
            print(json_module.dumps({"error": message, "exit_code": code}))
        print(f"labmate-drive: {message}", file=sys.stderr)
        raise typer.Exit(code)

    def say(self, message: str) -> None:
        """A line of progress on stderr."""
        print(message, file=sys.stderr, flush=True)

    def show(self, document: Any, render: Callable[[], None]) -> None:
        """The result: the JSON document, or what `render` prints."""
        if self.json:
            print(json_module.dumps(document, indent=1))
        else:
            render()

    def base_config(self) -> BaseConfig | None:
        """The configuration that was asked for, or lies here; None when there is none. Raises ConfigError."""
        from labmate.config import read_config

        if self.config is not None:
            return read_config(Path(self.config))
        if not self.sim and Path(DEFAULT_FILE).exists():
            return read_config(Path(DEFAULT_FILE))
        return None

    def config_to_stop_by(self) -> BaseConfig | None:
        """The configuration; a wrong one is said and passed over where the port is named: no file prevents a stop.

        Raises ConfigError when the port is not named.
        """
        from medusa.errors import ConfigError

        try:
            return self.base_config()
        except ConfigError as error:
            if self.port is None:
                raise
            self.say(f"{error}; stopping without it")
            return None

    def calibration_file(self) -> CalibrationFile | None:
        """The calibration that was asked for on the command line. Raises ConfigError."""
        from labmate.config import read_calibration

        return None if self.calibration is None else read_calibration(Path(self.calibration))

    def port_of(self, config: BaseConfig | None) -> str:
        """Where the real base hangs; raises CommandError when nobody said it."""
        from medusa.errors import CommandError

        port = self.port or (config.port.path if config is not None else None)
        if port is None:
            raise CommandError(
                "no base named: give --port /dev/ttyUSB0 (or port.path in the configuration), or --sim"
            )
        return port

    def open_trace(self) -> Trace | None:
        """The wire trace that was asked for. Raises OSError when its file cannot be made."""
        if self.trace is None:
            return None
        from medusa.link import Trace

        return Trace(self.trace)

    @asynccontextmanager
    async def base(self, *, to_stop: bool = False) -> AsyncIterator[tuple[Base, SimulatedBase | None]]:
        """The base, emulated or real, connected and standing; `to_stop` it neither file is needed."""
        from labmate.base import open_base
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


def exit_code(error: Exception) -> int:
    """The exit code of an expected error, by whose fault it was (docs/labmate.md)."""
    from labmate.errors import StalePose
    from medusa.errors import CommandError, ConfigError, NoReply, PortError, ProtocolError

    if isinstance(error, ConfigError):
        return _CONFIGURATION
    if isinstance(error, PortError):
        return _PORT
    if isinstance(error, NoReply | ProtocolError | StalePose):
        return _NO_ANSWER
    return _USAGE if isinstance(error, CommandError) else _FAULT


async def _cancelled_by_signals(body: Callable[[], Awaitable[T]], caught: list[signal.Signals]) -> T:
    loop = asyncio.get_running_loop()
    task = asyncio.current_task()

    def stop(number: signal.Signals) -> None:
        # Once: what follows is the confirmed stop, which a second Ctrl-C shall not cut short.
        if not caught and task is not None:
            task.cancel()
        caught.append(number)

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        # Not available outside the main thread, as in a test runner's worker.
        with contextlib.suppress(RuntimeError, ValueError):
            loop.add_signal_handler(number, stop, number)
    return await body()
