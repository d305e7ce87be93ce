"""Sequence numbers of one device's requests: rising modulo 64, and out of use while an answer may still come."""

from typing import Final

COUNT: Final = 64
QUARANTINE_S: Final = 1.0
# The device answers a request equal to one of its last eight from memory, so the same bytes must not come again
# before eight later requests were answered; up to eight of those that follow may have been sent earlier.
_ANSWERS_BEFORE_REUSE: Final = 16
_LIVE: Final = 1 << 62


class SequenceNumbers:
    """Gives numbers out and takes them back; time is an argument."""

    def __init__(self) -> None:
        self._next = 0
        self._answered = 0
        self._usable_from = [0] * COUNT
        self._until = [0.0] * COUNT
        self._copies = [0] * COUNT
        self._received = [True] * COUNT

    def take(self, now: float, kept: bool = True) -> int | None:
        """Return the next number in rising order that may be used, None when there is none.

        `kept` is False for a HELLO, which a device never answers from memory.
        """
        number = self._next
        bound = self._answered if kept else _LIVE - 1
        for _ in range(COUNT):
            if self._usable_from[number] <= bound and self._until[number] <= now:
                self._usable_from[number] = _LIVE
                self._next = (number + 1) % COUNT
                return number
            number = (number + 1) % COUNT
        return None

    def take_anyway(self, now: float) -> int:
        """Return a number for a stop, which cannot wait: if none is free, the one longest out of use."""
        number = self.take(now)
        if number is not None:
            return number
        number = min(range(COUNT), key=lambda n: (self._usable_from[n], self._until[n]))
        self._usable_from[number] = _LIVE
        self._next = (number + 1) % COUNT
        return number

    def answered(self, number: int, now: float, copies_left: int) -> None:
        """Take a number back whose request was answered; copies sent in repeats may each be answered yet."""
        self._answered += 1
        self._usable_from[number] = self._answered + _ANSWERS_BEFORE_REUSE
        if copies_left:
            self._keep_out(number, now, copies_left, received=True)

    def abandoned(self, number: int, now: float, copies_left: int) -> None:
        """Take a number back whose request ended without an answer to any of its copies."""
        self._usable_from[number] = self._answered + _ANSWERS_BEFORE_REUSE
        self._keep_out(number, now, copies_left, received=False)

    def _keep_out(self, number: int, now: float, copies_left: int, *, received: bool) -> None:
        self._received[number] = received
        self._copies[number] = copies_left
        self._until[number] = now + QUARANTINE_S if copies_left else 0.0

    def late(self, number: int, now: float) -> None:
        """Note a late reply: one copy less to wait for; the first also shows that the device took the request."""
        if self._until[number] <= now:
            return
        if not self._received[number]:
            self._received[number] = True
            self._answered += 1
        self._copies[number] -= 1
        if self._copies[number] <= 0:
            self._until[number] = 0.0

    def new_session(self) -> None:
        """Forget what the device has forgotten: its kept replies."""
        self._usable_from = [_LIVE if mark == _LIVE else 0 for mark in self._usable_from]

    def next_release(self, now: float) -> float | None:
        """Return when the next number leaves its quarantine."""
        return min((until for until in self._until if until > now), default=None)
