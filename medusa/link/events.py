"""Events of one device: each handed on once, however often it comes."""

from medusa.link.frame import ACKNOWLEDGEMENT, Message
from medusa.link.messages import Event


class Inbox:
    """Separates new events from repeats: equal operation, axis, sequence number and payload are a repeat."""

    def __init__(self) -> None:
        self._last: dict[int, Event] = {}

    def accept(self, message: Message) -> Event | None:
        """Return the event when it is new, None when it is a repeat."""
        event = Event(message.operation, message.axis, message.payload, message.sequence)
        if self._last.get(event.sequence) == event:
            return None
        self._last[event.sequence] = event
        return event

    def new_session(self) -> None:
        """Forget every event: the device counts from 0 again."""
        self._last.clear()


def acknowledge(message: Message) -> Message:
    """Return the acknowledgement of an event."""
    return Message(message.address, ACKNOWLEDGEMENT, message.sequence, message.operation, 0)
