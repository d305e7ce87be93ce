"""What every command shares: the options before it, the head they lead to, and how a command ends."""

import asyncio
import contextlib
import json as json_module
import logging
import signal
import sys
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Coroutine, Mapping, Sequence
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, TypeVar

import typer

if TYPE_CHECKING:
    from medusa.head.joint_group import JointGroup
    from medusa.link import Trace
    from medusa.mc3000.config import HeadConfig
    from medusa.simulation import SimulatedHead

T = TypeVar("T")

_FLAGS = {"--sim", "--json", "--realtime", "--verbose"}
_VALUES = {"--boards", "--amps", "--config", "--trace", "--seed"}
_EXIT_CODES = {"caller": 2, "configuration": 3, "port": 4, "line": 5, "device": 6, "unknown": 6}


def globals_first(arguments: Sequence[str]) -> list[str]:
    """The arguments with the options that every command shares before the command, wherever they were typed."""
    front: list[str] = []
    rest: list[str] = []
    words = iter(arguments)
    for word in words:
        if word == "--":
            rest += [word, *words]
        elif word in _FLAGS or (word.split("=")[0] in _VALUES and "=" in word):
            front.append(word)
        elif word in _VALUES:
            front += [word, *([value] if (value := next(words, None)) is not None else [])]
        else:
            rest.append(word)
    return front + rest


def complain(message: str, code: int, *, json: bool, so_far: Mapping[str, Any] | None = None) -> None:
    """What went wrong as one line on stderr; with `json` as the document on stdout, too."""
    if json:
        _print_json({**(so_far or {}), "error": message, "exit_code": code})
    print(f"medusa-ctl: {message}", file=sys.stderr)


def _print_json(document: Mapping[str, Any]) -> None:
    print(json_module.dumps(document, indent=1, default=str))


class Once(logging.Filter):
    """Lets each text through once: a pulled cable is noticed in several places."""

    def __init__(self) -> None:
        super().__init__()
        self._told: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        """True for what was not told yet."""
        text = record.getMessage()
        if text in self._told:
            return False
        self._told.add(text)
        return True


@dataclass(frozen=True)
class Options:
    """The options before the command."""

    sim: bool = False
    boards: str | None = None
    amps: str | None = None
    config: str | None = None
    json: bool = False
    trace: str | None = None
    seed: int = 0
    realtime: bool = False
    verbose: bool = False
    so_far: dict[str, Any] = field(default_factory=dict)
    """What a command had to show when it was interrupted; part of the JSON document then."""

    def run(self, body: Callable[[], Coroutine[Any, Any, T]], *, realtime: bool = False) -> T:
        """Run a command's coroutine on the right clock; every expected error becomes one line and an exit
        code.

        SIGINT and SIGTERM cancel it, so that the head is stopped and the stop confirmed on the way out.
        """
        told = logging.StreamHandler(sys.stderr)
        told.addFilter(Once())
        logging.basicConfig(
            level=logging.INFO if self.verbose else logging.WARNING,
            format="%(levelname)s %(message)s",
            handlers=[told],
        )
        from medusa.errors import MedusaError
        from perception.camera.errors import CameraError

        caught: list[signal.Signals] = []
        try:
            if self.sim and not (self.realtime or realtime):
                from medusa.simulation import run_virtual

                return run_virtual(_cancelled_by_signals(body, caught))
            return asyncio.run(_cancelled_by_signals(body, caught))
        except asyncio.CancelledError as ended:
            number = caught[0] if caught else signal.SIGINT
            if unconfirmed := _notes(ended):
                self.fail(f"interrupted by {number.name}{unconfirmed}", _EXIT_CODES["device"])
            self.fail(f"stopped by {number.name}; the head is at rest", 128 + number)
        except MedusaError as error:
            protocol = type(error).__name__ == "ProtocolError"
            self.fail(str(error) + _notes(error), 5 if protocol else _EXIT_CODES[error.fault])
        except CameraError as error:
            self.fail(str(error), 4)
        except OSError as error:
            self.fail(f"{error.filename or 'i/o'}: {error.strerror or error}", 4)

    def fail(self, message: str, code: int) -> NoReturn:
        """One line on stderr (and the JSON document, where one is due), and the end."""
        complain(message, code, json=self.json, so_far=self.so_far)
        raise typer.Exit(code)

    def make_folder(self, path: Path) -> None:
        """Make the folder for results: before anything moves, since afterwards it would be too late."""
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.fail(f"{path}: {error.strerror}", _EXIT_CODES["port"])

    def say(self, message: str) -> None:
        """A line of progress on stderr."""
        print(message, file=sys.stderr, flush=True)

    def show(self, document: dict[str, Any], render: Callable[[], None]) -> None:
        """The result: the JSON document, or what `render` prints."""
        if self.json:
            _print_json(document)
        else:
            render()

    def head_config(self) -> "HeadConfig | None":
        """The configuration that was asked for; None for the simulated head's own. Raises ConfigError."""
        from medusa.config.file import DEFAULT_FILE, load_config
        from medusa.errors import ConfigError

        if self.config is not None:
            return load_config(self.config)
        if self.sim:
            return None
        if not Path(DEFAULT_FILE).exists():
            raise ConfigError(
                DEFAULT_FILE,
                "",
                None,
                "does not exist; `medusa-ctl init` writes one, or name one by --config",
            )
        return load_config(DEFAULT_FILE)

    def open_trace(self) -> "Trace | None":
        """The wire trace that was asked for. Raises OSError when its file cannot be made."""
        if self.trace is None:
            return None
        from medusa.link import Trace

        return Trace(self.trace)

    @asynccontextmanager
    async def head(
        self,
        *,
        homed: bool = False,
        joints: Collection[str] | None = None,
        enable: bool = False,
        amplifiers: bool = True,
        world: Any = None,
    ) -> AsyncIterator["tuple[JointGroup, SimulatedHead | None]"]:
        """The head, emulated or real, connected and at rest; enabled, or homed, when the command needs that.

        `joints`: those that the command moves (default: all). An emulated head has just been switched on: it is
        homed first, and that is said. A real one is never homed behind one's back. Raises CommandError then.
        Without `amplifiers` a real head's are left alone: neither their port nor their answers are needed.
        """
        from medusa.errors import CommandError, NoReply
        from medusa.machines import open_head

        if self.sim and (self.boards or self.amps):
            raise CommandError("--sim brings its own ports: leave --boards and --amps out")
        config = self.head_config()
        trace = self.open_trace()
        async with AsyncExitStack() as stack:
            if trace is not None:
                stack.callback(trace.close)
            simulated = None
            if self.sim:
                from medusa.simulation import simulated_head

                simulated = await stack.enter_async_context(simulated_head(self.seed, world=world))
                head = await stack.enter_async_context(simulated.open(config, trace))
            else:
                if config is None:
                    raise AssertionError("a real head has a configuration")
                opening = open_head(config, self.boards, self.amps if amplifiers else False, trace=trace)
                try:
                    head = await stack.enter_async_context(opening)
                except NoReply as error:
                    port = self.boards or config.ports.boards
                    error.add_note(f"is it on, and is {port} its port, at {config.ports.baud} baud?")
                    raise
            if homed and self.sim:
                self.say("simulated head, just switched on: homing it first")
                await head.home()
            elif homed:
                needed = head.traits if joints is None else joints
                reading = await head.read()
                away = [name for name, joint in reading.joints.items() if name in needed and not joint.homed]
                if away:
                    raise CommandError(f"{', '.join(away)}: not homed; run `medusa-ctl home` first")
                await head.enable(needed)
            elif enable:
                await head.enable()
            yield head, simulated


def _notes(error: BaseException) -> str:
    """What went wrong besides, after the error: a stop that could not be confirmed."""
    return "".join(f"; {note}" for note in getattr(error, "__notes__", ()))


async def _cancelled_by_signals(body: Callable[[], Awaitable[T]], caught: list[signal.Signals]) -> T:
    loop = asyncio.get_running_loop()
    task = asyncio.current_task()

    def stop(number: signal.Signals) -> None:
        caught.append(number)
        if task is not None and len(caught) == 1:
            task.cancel()
        else:
            # A second cancellation would end the stopping itself.
            print("medusa-ctl: still stopping the head", file=sys.stderr, flush=True)

    for number in (signal.SIGINT, signal.SIGTERM):
        # Not available outside the main thread, as in a test runner's worker.
        with contextlib.suppress(RuntimeError, ValueError):
            loop.add_signal_handler(number, stop, number)
    return await body()
