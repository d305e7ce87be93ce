"""A conversation with one device on a line."""

from collections.abc import AsyncIterator, Callable
from typing import TYPE_CHECKING

from medusa.errors import MedusaError
from medusa.link.messages import WHOLE_DEVICE, Event, Hello, Statistics

if TYPE_CHECKING:
    from medusa.link.line import Line


class Session:
    """One device's requests, replies and events.

    After the port vanished or the device fell silent, the line reopens and greets on its own; from then on
    everything but motion is accepted, and requests with `moves=True` are refused (CommandError) until the
    driver calls `open()` again: it has to restore watchdog, event mask and settings first.
    """

    address: int
    hello: Hello | None
    line: "Line"
    generation: int

    async def open(self) -> Hello:
        """Open a new session with HELLO, after which the machine stands, mask and watchdog are off."""
        raise NotImplementedError

    async def request(
        self,
        operation: int,
        axis: int = WHOLE_DEVICE,
        payload: bytes = b"",
        *,
        reads: bool = False,
        moves: bool = False,
        stops: bool = False,
        urgent: bool | None = None,
        deadline: float | None = None,
    ) -> bytes:
        """Send one request and return its reply's payload.

        `reads`: changes nothing that another request depends on; such requests overlap freely (up to four).
        Without it a request acts, and waits while one that acts on the same axis (0FH: any) is unanswered.
        `moves`: can move something; withdrawn by a stop, never sent again by a reconnection.
        `stops`: STOP, MODE 0, EMERGENCY_STOP, CLEAR: withdraws every unanswered motion first.
        `urgent`: needs no free place in the window (default: `stops`, except CLEAR; False for MODE 0).
        `deadline`: seconds for each of three sendings (default: the line's `reply_timeout`).

        Raises CommandError (the device refused: `status`), NoReply (also Withdrawn, DeviceSilent), PortError,
        DeviceRestarted (answered "no HELLO since power-up"). Cancelling is safe.
        """
        raise NotImplementedError

    def events(self) -> AsyncIterator[Event]:
        """Return a stream of the device's events, each once, from now on."""
        raise NotImplementedError

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Call back for each event; returns what ends the subscription."""
        raise NotImplementedError

    def on_restart(self, callback: Callable[[MedusaError], None]) -> Callable[[], None]:
        """Call back with DeviceRestarted when a HELLO shows another boot count; returns what ends it."""
        raise NotImplementedError

    def on_lost(self, callback: Callable[[MedusaError], None]) -> Callable[[], None]:
        """Call back with PortError or DeviceSilent when the device is heard no more; returns what ends it."""
        raise NotImplementedError

    async def ping(self) -> int:
        """Return the device's time, µs since its power-up."""
        raise NotImplementedError

    async def statistics(self) -> Statistics:
        """Return the device's own counters."""
        raise NotImplementedError

    async def watchdog(self, timeout_ms: int, action: int = 0) -> None:
        """Set the device's watchdog; 0 ms switches it off."""
        raise NotImplementedError

    async def emergency_stop(self) -> None:
        """Stop this device at once and latch it."""
        raise NotImplementedError

    async def clear(self, axis: int = WHOLE_DEVICE) -> None:
        """Release what is latched and whose cause is gone."""
        raise NotImplementedError

    async def event_mask(self, mask: int) -> None:
        """Let the events of the mask through (bit n: event 40H + n)."""
        raise NotImplementedError
