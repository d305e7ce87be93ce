"""The bench: emulated machines, the lines that they hang on, and what can be seen and done out of band."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any, Protocol

from sim_devices.link.line import Device


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
