"""Events of a framed device: numbered, repeated until acknowledged, at most eight unacknowledged."""

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from math import inf

REPEAT_S = 0.1
SENDINGS = 6
OUTSTANDING = 8


@dataclass(slots=True)
class _Sent:
    operation: int
    axis: int
    payload: bytes
    sequence: int
    sendings: int
    due: float


class EventQueue:
    """Sends each event once and again every 100 ms, six times in all, until it is acknowledged.

    `send(operation, axis, payload, sequence, t)` puts one on the line. `due` is the next time at which
    something is to be done, or infinity.
    """

    def __init__(self, send: Callable[[int, int, bytes, int, float], None]) -> None:
        self._send = send
        self._sent: list[_Sent] = []
        self._waiting: deque[tuple[int, int, bytes]] = deque()
        self._sequence = 0
        self.given_up = 0
        self.due = inf

    def reset(self) -> None:
        """Forget everything and count from 0: a HELLO. The number given up is kept."""
        self._sent.clear()
        self._waiting.clear()
        self._sequence = 0
        self.due = inf

    def add(self, operation: int, axis: int, payload: bytes, t: float) -> None:
        """Send an event at t, or after those that wait."""
        self._waiting.append((operation, axis, payload))
        self._fill(t)

    def acknowledge(self, operation: int, sequence: int, t: float) -> None:
        """Drop the event of this operation and sequence number, if there is one."""
        for event in self._sent:
            if event.sequence == sequence and event.operation == operation:
                self._sent.remove(event)
                self._fill(t)
                return

    def advance_to(self, t: float) -> None:
        """Repeat or give up what is due at t."""
        for event in tuple(self._sent):
            if event.due > t:
                continue
            if event.sendings == SENDINGS:
                self._sent.remove(event)
                self.given_up += 1
                continue
            event.sendings += 1
            event.due += REPEAT_S
            self._send(event.operation, event.axis, event.payload, event.sequence, t)
        self._fill(t)

    def _fill(self, t: float) -> None:
        while self._waiting and len(self._sent) < OUTSTANDING:
            operation, axis, payload = self._waiting.popleft()
            event = _Sent(operation, axis, payload, self._sequence, 1, t + REPEAT_S)
            self._sequence = self._sequence + 1 & 0x3F
            self._sent.append(event)
            self._send(operation, axis, payload, event.sequence, t)
        self.due = min((event.due for event in self._sent), default=inf)
