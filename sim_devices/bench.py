"""The bench: emulated machines, the lines that they hang on, and what can be seen and done out of band."""

import asyncio
import inspect
import logging
import shutil
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Protocol, get_type_hints

import msgspec

from sim_devices.link.faults import FaultPlan
from sim_devices.link.line import Device, Line

log = logging.getLogger(__name__)


class Part(Protocol):
    """A machine on the bench: head, base, world. Times are the running event loop's, in seconds."""

    verbs: Mapping[str, Callable[..., Any]]
    """What `sim-devices inject` may call, with keyword arguments (numbers, strings, booleans; SI and rad)."""

    def power_up(self, t: float) -> None:
        """Switch everything on at t, before any line is served."""

    def lines(self) -> Mapping[str, Sequence[Device]]:
        """Return the devices on each line, by the line's name."""

    def advance_to(self, t: float) -> None:
        """Run the machine up to t (verbs and `state` see it there); a t in the past does nothing."""

    def state(self) -> dict[str, Any]:
        """Return the true state: JSON-able, SI and rad."""


class UnknownVerb(LookupError):
    """No part has such a verb, or not with such arguments."""


class Bench:
    """Machines behind their lines: `async with Bench({"head": machine}) as bench: … bench.ports["mc3000"]`.

    Parts that name the same line share it. Without `links` the ports are links in a directory of their own:
    a path stays the same when a cable is pulled. `faults` is one plan for every line or one for each.
    The directory of the links must exist.
    """

    def __init__(
        self,
        parts: Mapping[str, Part],
        *,
        seed: int | None = None,
        baud: int = 115200,
        faults: FaultPlan | Mapping[str, FaultPlan] | None = None,
        links: Path | None = None,
    ) -> None:
        self.parts = dict(parts)
        self.lines: dict[str, Line] = {}
        self._seed = seed if seed is not None else 0
        self._baud = baud
        self._faults = faults
        self._links = links
        self._own_links: Path | None = None

    @property
    def ports(self) -> dict[str, str]:
        """Where each line is opened."""
        return {name: line.path for name, line in self.lines.items()}

    async def __aenter__(self) -> "Bench":
        links = self._links
        if links is None:
            links = self._own_links = Path(tempfile.mkdtemp(prefix="sim-devices-"))
        try:
            await self._start(links)
        except BaseException:
            await self.__aexit__()
            raise
        return self

    async def __aexit__(self, *exc_info: object) -> None:
        for line in self.lines.values():
            await line.stop()
        if self._own_links is not None:
            shutil.rmtree(self._own_links, ignore_errors=True)

    async def _start(self, links: Path) -> None:
        now = asyncio.get_running_loop().time()
        devices: dict[str, list[Device]] = {}
        sharers: dict[str, set[str]] = {}
        for part in self.parts.values():
            part.power_up(now)
            lines = part.lines()
            for name, on_line in lines.items():
                devices.setdefault(name, []).extend(on_line)
                sharers.setdefault(name, set()).update(lines)
        self._check_fault_lines(set(devices))
        for name, on_line in devices.items():
            self.lines[name] = Line(on_line, self._baud, self._plan(name), name=name, link=links / name)
        for name, line in self.lines.items():
            others = [self.lines[other] for other in sorted(sharers[name] - {name})]
            if others:
                line.on_receive = _rearm_all(others)
            await line.start()

    def _plan(self, line: str) -> FaultPlan | None:
        plan = self._faults if isinstance(self._faults, FaultPlan) else (self._faults or {}).get(line)
        if plan is None or plan.seed is not None:
            return plan
        return msgspec.structs.replace(plan, seed=self._seed)

    def _check_fault_lines(self, lines: set[str]) -> None:
        if isinstance(self._faults, Mapping):
            for name in self._faults:
                if name not in lines:
                    raise ValueError(f"faults for line {name!r}, there are {', '.join(sorted(lines))}")

    def verbs(self) -> dict[str, Callable[..., Any]]:
        """Return everything that `inject` may call: "part.verb" and "wire.verb"."""
        verbs: dict[str, Callable[..., Any]] = {
            "wire.unplug": self._unplug,
            "wire.plug": self._plug,
            "wire.hang_up": self._hang_up,
            "wire.stall": self._stall,
            "wire.faults": self._set_faults,
        }
        for name, part in self.parts.items():
            verbs.update({f"{name}.{verb}": call for verb, call in part.verbs.items()})
        return verbs

    def describe_verbs(self) -> dict[str, str]:
        """Return every verb with its arguments and what it does."""
        return {
            name: f"{_arguments(call)} {(inspect.getdoc(call) or '').partition(chr(10))[0]}"
            for name, call in sorted(self.verbs().items())
        }

    def inject(self, verb: str, **arguments: Any) -> Any:
        """Call a verb now and let every line look again; raises UnknownVerb, ValueError."""
        call = self.verbs().get(verb)
        if call is None:
            raise UnknownVerb(f"no verb {verb!r}; there are {', '.join(sorted(self.verbs()))}")
        try:
            inspect.signature(call).bind(**arguments)
        except TypeError as error:
            raise UnknownVerb(f"{verb}{_arguments(call)}: {error}") from None
        _check_types(call, arguments)
        self._advance()
        log.info("inject %s %s", verb, arguments)
        try:
            return call(**arguments)
        finally:
            for line in self.lines.values():
                line.rearm()

    def state(self) -> dict[str, Any]:
        """Return the true state of every part at the present instant, and of the lines."""
        self._advance()
        return {
            "time": asyncio.get_running_loop().time(),
            "lines": {
                name: {"plugged": line.plugged, "lost_bytes": line.lost_bytes}
                for name, line in self.lines.items()
            },
            **{name: part.state() for name, part in self.parts.items()},
        }

    def _advance(self) -> None:
        now = asyncio.get_running_loop().time()
        for part in self.parts.values():
            part.advance_to(now)

    def _line(self, name: str) -> Line:
        if name not in self.lines:
            raise ValueError(f"no line {name!r}; there are {', '.join(sorted(self.lines))}")
        return self.lines[name]

    def _unplug(self, line: str) -> None:
        """Pull a line's cable."""
        self._line(line).unplug()

    def _plug(self, line: str) -> None:
        """Put a line's cable in."""
        self._line(line).plug()

    def _hang_up(self, line: str, seconds: float) -> None:
        """Pull a line's cable for a time (s)."""
        self._line(line).hang_up(_positive("seconds", seconds))

    def _stall(self, line: str, seconds: float) -> None:
        """Let nothing onto a line for a time (s)."""
        self._line(line).stall(_positive("seconds", seconds))

    def _set_faults(self, line: str, **plan: Any) -> None:
        """Let a wire misbehave by the keys of a faults file, from now on; without any: no more."""
        try:
            faults = msgspec.convert({"seed": self._seed, **plan}, FaultPlan) if plan else None
        except msgspec.ValidationError as error:
            raise ValueError(str(error)) from None
        self._line(line).set_faults(faults)


def _rearm_all(lines: Sequence[Line]) -> Callable[[], None]:
    def rearm() -> None:
        for line in lines:
            line.rearm()

    return rearm


def _arguments(call: Callable[..., Any]) -> str:
    return str(inspect.signature(call).replace(return_annotation=inspect.Signature.empty))


def _check_types(call: Callable[..., Any], arguments: Mapping[str, Any]) -> None:
    hints = get_type_hints(call)
    for name, value in arguments.items():
        try:
            msgspec.convert(value, hints.get(name, Any))
        except msgspec.ValidationError as error:
            told = str(error)
            raise ValueError(f"{name} = {value!r}: {told[:1].lower()}{told[1:]}") from None


def _positive(name: str, value: float) -> float:
    if not 0 < value < float("inf"):
        raise ValueError(f"{name} is {value}, must be above 0")
    return value
