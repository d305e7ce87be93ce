"""The options that every command line has, and how a command runs, shows its result, and fails."""

import asyncio
import signal
import sys
from abc import ABC, abstractmethod
from collections.abc import Callable, Coroutine, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any, ClassVar, NoReturn, TypeVar

import typer

from medusa.console import exit_codes
from medusa.console.output import print_error, print_json, set_up_log
from medusa.console.signals import cancelled_by_signals

if TYPE_CHECKING:
    from medusa.link import Trace

T = TypeVar("T")


@dataclass(frozen=True, kw_only=True)
class Console(ABC):
    """What the options before a command ask for; a command line adds those of its machine.

    `program` is its name, `machine` the noun for what it drives.
    """

    program: ClassVar[str]
    machine: ClassVar[str]

    sim: bool = False
    json: bool = False
    trace: str | None = None
    seed: int = 0
    realtime: bool = False
    verbose: bool = False
    so_far: dict[str, Any] = field(default_factory=dict)
    """What a command had to show when it was interrupted; part of the JSON document then."""

    @abstractmethod
    def run_virtual(self, main: Coroutine[Any, Any, T]) -> T:
        """Run a coroutine in virtual time, as --sim does."""

    def run(self, body: Callable[[], Coroutine[Any, Any, T]], *, realtime: bool = False) -> T:
        """Run a command's coroutine on the right clock; an expected error becomes one line and an exit code.

        SIGINT, SIGTERM and SIGHUP cancel it, so that the machine is stopped and the stop confirmed on the way out.
        """
        set_up_log(self.verbose)
        from medusa.errors import MedusaError
        from perception.camera.errors import CameraError

        caught: list[signal.Signals] = []
        main = cancelled_by_signals(body, caught, f"{self.program}: still stopping the {self.machine}")
        try:
            if self.sim and not (self.realtime or realtime):
                return self.run_virtual(main)
            return asyncio.run(main)
        except asyncio.CancelledError as ended:
            self._interrupted(caught[0] if caught else signal.SIGINT, ended)
        except (MedusaError, CameraError) as error:
            self.fail(str(error) + _notes(error), exit_codes.exit_code(error))
        except OSError as error:
            if caught:
                # A terminal that hangs up fails its writers, too.
                self._interrupted(caught[0], error)
            if isinstance(error, BrokenPipeError):
                raise
            self.fail(f"{error.filename or 'i/o'}: {error.strerror or error}", exit_codes.PORT)

    def _interrupted(self, number: signal.Signals, ended: BaseException) -> NoReturn:
        if unconfirmed := _notes(ended):
            self.fail(f"interrupted by {number.name}{unconfirmed}", exit_codes.FAULT)
        self.fail(f"stopped by {number.name}; the {self.machine} is at rest", exit_codes.SIGNAL + number)

    def fail(self, message: str, code: int = exit_codes.USAGE) -> NoReturn:
        """One line on stderr (and the JSON document, where one is due), and the end."""
        print_error(self.program, message, code, as_json=self.json, so_far=self.so_far)
        raise typer.Exit(code)

    def make_folder(self, path: Path) -> None:
        """Make the folder for results: before anything moves, since afterwards it would be too late."""
        try:
            path.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            self.fail(f"{path}: {error.strerror}", exit_codes.PORT)

    def progress(self, message: str) -> None:
        """A line of progress on stderr."""
        print(message, file=sys.stderr, flush=True)

    def show(self, document: Mapping[str, Any], render: Callable[[], None]) -> None:
        """The result: the JSON document, or what `render` prints."""
        if self.json:
            print_json(document)
        else:
            render()

    def open_trace(self) -> "Trace | None":
        """The wire trace that was asked for. Raises OSError when its file cannot be made."""
        if self.trace is None:
            return None
        from medusa.link import Trace

        return Trace(self.trace)


def _notes(error: BaseException) -> str:
    """What went wrong besides, after the error: a stop that could not be confirmed."""
    notes = [*getattr(error, "__notes__", ())]
    if isinstance(error, asyncio.CancelledError) and error.__cause__ is not None:
        # What was carried through although cancelled has failed itself (medusa.completion).
        notes.append(str(error.__cause__))
    return "".join(f"; {note}" for note in notes)
