"""What a framed device does, apart from its session: the seam between `LinkDevice` and a machine's firmware."""

from collections.abc import Callable
from typing import NamedTuple, Protocol


class Refused(Exception):
    """An operation refused with a status other than 0; nothing has changed."""

    def __init__(self, status: int) -> None:
        super().__init__(f"refused with status {status}")
        self.status = status


class Executed(NamedTuple):
    """One command that acted (or was refused): repeats answered from the kept replies are not among them."""

    time: float
    sequence: int
    operation: int
    axis: int
    payload: bytes
    status: int


class Application(Protocol):
    """What a framed device does; `LinkDevice` carries it. Times are the loop's, in seconds.

    `LinkDevice` has always advanced it to the present before it calls anything else.
    """

    device_type: int
    firmware: int
    axes: frozenset[int]
    """The axes that CLEAR may name, besides 0FH."""

    watchdog_actions: frozenset[int]
    emit: Callable[[int, int, bytes], None]
    """Set by LinkDevice: emit(operation, axis, payload). It masks, numbers, queues and repeats."""

    def attach(self, power_up: float) -> None:
        """Take the time of power-up: stamps are round((t − power_up) 10⁶) & FFFFFFFFH µs."""

    def hello_part(self) -> bytes:
        """Return the device's own part of the HELLO reply."""

    def advance_to(self, t: float) -> None:
        """Run up to t; a t in the past does nothing."""

    def next_due(self) -> float | None:
        """Return when `advance_to` is wanted next, or None."""

    def execute(self, operation: int, axis: int, payload: bytes) -> bytes:
        """Carry out an operation from 10H on; return the reply's payload or raise Refused (1 if unknown)."""

    def new_session(self) -> None:
        """HELLO: act as the watchdog's action 0, forget armed moves and latches. The mask is 0 already."""

    def emergency_stop(self) -> bool:
        """Latch the emergency stop; when it was not latched yet emit event 43 and return True."""

    def clear(self, axis: int) -> None:
        """CLEAR on an axis or 0FH; may raise Refused(2)."""

    def watchdog(self, action: int) -> None:
        """The watchdog expired: act, and emit event 44."""

    def watchdog_set(self, on: bool) -> None:
        """The watchdog was switched on or off (HELLO: off, after new_session)."""

    def restart(self, t: float) -> None:
        """A power cycle at t: every state but the machine's own place is lost; `attach(t)` follows."""
