"""An emulated serial line: devices behind one pseudo-tty."""

from collections.abc import Callable
from typing import Protocol


class Device(Protocol):
    """Something on a serial line. Every time is the running event loop's, in seconds.

    The line calls in rising order of time. A machine shared by several lines may, on the wall clock, be
    asked for a time a little before one that another line asked for: `advance_to` then does nothing.
    """

    send: Callable[[bytes, float], None]
    """Set by the line: put one whole frame on the wire at a time; it is paced, and never interleaved."""

    def receive(self, data: bytes, t: float) -> None:
        """Take bytes of which the last has arrived at t. Advance to t first."""

    def advance_to(self, t: float) -> None:
        """Run physics and firmware up to t, exactly; a t in the past does nothing."""

    def next_due(self) -> float | None:
        """When to call `advance_to` although no byte comes (event, watchdog, ≤ 5 ms in motion), or None."""
