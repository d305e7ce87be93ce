"""What stops the head: faults as typed events that name the axes, and those who wait for them."""

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum

from medusa.errors import DeviceFault
from medusa.mc3000.board import BoardEvent, Inputs, Operation

log = logging.getLogger(__name__)


class FaultKind(Enum):
    """Why an axis stopped by itself."""

    LIMIT = "limit switch"
    FOLLOWING = "following error"
    AMPLIFIER = "amplifier fault"
    EMERGENCY_STOP = "emergency stop"
    WATCHDOG = "watchdog expired"
    STOP_INPUT = "stop input"
    RESTARTED = "board restarted"
    LOST = "line lost"
    STALLED = "does not follow its command velocity"
    SOFT_LIMIT = "soft limit"


@dataclass(frozen=True)
class Fault:
    """One fault: its kind, the joints it concerns, one line for people, the loop's time, s."""

    kind: FaultKind
    axes: tuple[str, ...]
    reason: str
    time: float

    @property
    def stops_head(self) -> bool:
        """True when the other joints have to stop, too; a joint held at its soft limit stops alone."""
        return self.kind is not FaultKind.SOFT_LIMIT

    def error(self) -> DeviceFault:
        """The exception that a running move ends with."""
        return HeadFault(self)


class HeadFault(DeviceFault):
    """A joint stopped by itself; `fault` says which and why."""

    def __init__(self, cause: Fault, also: str = "") -> None:
        self.cause = cause
        names = ", ".join(cause.axes)
        super().__init__(f"{names}: {cause.reason}" + (f"; {also}" if also else ""), axis=names)


_KINDS = {
    Operation.LIMIT_REACHED: FaultKind.LIMIT,
    Operation.STOP_INPUT: FaultKind.STOP_INPUT,
    Operation.EMERGENCY_STOPPED: FaultKind.EMERGENCY_STOP,
    Operation.WATCHDOG_EXPIRED: FaultKind.WATCHDOG,
    Operation.FOLLOWING_ERROR: FaultKind.FOLLOWING,
    Operation.AMPLIFIER_FAULT: FaultKind.AMPLIFIER,
}


def fault_from_event(event: BoardEvent, axes: tuple[str, ...], time: float) -> Fault | None:
    """The fault that a board's event reports, None when the event reports none."""
    kind = _KINDS.get(event.operation)
    if kind is None or not axes:
        return None
    reason = kind.value
    if kind is FaultKind.LIMIT:
        closed = [
            name
            for bit, name in ((Inputs.NEGATIVE_LIMIT, "negative"), (Inputs.POSITIVE_LIMIT, "positive"))
            if event.inputs & bit
        ]
        reason = f"{' and '.join(closed) or 'a'} limit switch reached at {event.position} counts"
    elif kind is FaultKind.FOLLOWING:
        reason = f"following error at {event.position} counts: the joint does not follow its command"
    elif kind is FaultKind.AMPLIFIER:
        reason = f"amplifier fault (inputs {event.detail:02X}H)"
    elif kind is FaultKind.WATCHDOG:
        reason = "watchdog expired: the board did not hear the host in time"
    return Fault(kind, axes, reason, time)


class FaultHub:
    """Hands each fault to whoever claims it, else to every subscriber."""

    def __init__(self) -> None:
        self._subscribers: list[Callable[[Fault], None]] = []
        self._claims: list[tuple[str, frozenset[FaultKind], Callable[[Fault], None]]] = []

    def publish(self, fault: Fault) -> None:
        """Report a fault; an exception in a subscriber is logged and does not keep it from the others."""
        for axis, kinds, callback in list(self._claims):
            if fault.kind in kinds and fault.axes == (axis,):
                callback(fault)
                return
        log.warning("%s: %s", ", ".join(fault.axes), fault.reason)
        for subscriber in list(self._subscribers):
            try:
                subscriber(fault)
            except Exception:
                log.exception("a fault's subscriber failed")

    def subscribe(self, callback: Callable[[Fault], None]) -> Callable[[], None]:
        """Call back for each fault; returns what ends the subscription."""
        self._subscribers.append(callback)
        return lambda: self._subscribers.remove(callback)

    @contextmanager
    def claim(
        self, axis: str, kinds: frozenset[FaultKind], callback: Callable[[Fault], None]
    ) -> Iterator[None]:
        """Within the context this axis' faults of these kinds go to `callback` alone: they are expected."""
        entry = (axis, kinds, callback)
        self._claims.append(entry)
        try:
            yield
        finally:
            self._claims.remove(entry)

    async def stream(self) -> AsyncIterator[Fault]:
        """Every fault from now on."""
        queue: asyncio.Queue[Fault] = asyncio.Queue()
        end = self.subscribe(queue.put_nowait)
        try:
            while True:
                yield await queue.get()
        finally:
            end()
