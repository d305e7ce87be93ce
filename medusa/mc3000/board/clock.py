"""The board's time on the host's clock."""

WRAP_US = 1 << 32
DRIFT = 100e-6
"""How far two crystals may drift apart, s/s: the estimate yields by this much, so that it can follow."""


class BoardClock:
    """Maps the board's µs since power-up to the event loop's time.

    A reply cannot arrive before it was made, so of all differences (arrival − time on the wire − board time)
    the least is nearest to the truth; it is let rise by `DRIFT` to follow a slower host clock.
    """

    def __init__(self) -> None:
        self._offset: float | None = None
        self._updated = 0.0
        self._last_us = 0
        self._wraps = 0

    def reset(self) -> None:
        """Forget everything: the board restarted."""
        self._offset = None
        self._wraps = 0
        self._last_us = 0

    def update(self, time_us: int, arrival: float, wire_seconds: float) -> float:
        """Loop time of a reply stamped `time_us` that arrived after `wire_seconds` on the line, s."""
        board = self._unwrap(time_us)
        offset = arrival - wire_seconds - board
        if self._offset is None:
            self._offset = offset
        else:
            self._offset = min(offset, self._offset + DRIFT * max(0.0, arrival - self._updated))
        self._updated = arrival
        return board + self._offset

    def to_loop(self, time_us: int) -> float | None:
        """Loop time of a board time near the last one taken in, s; None before the first update."""
        if self._offset is None:
            return None
        near = (time_us - self._last_us + WRAP_US // 2) % WRAP_US - WRAP_US // 2
        return (self._wraps * WRAP_US + self._last_us + near) * 1e-6 + self._offset

    def _unwrap(self, time_us: int) -> float:
        if time_us < self._last_us - WRAP_US // 2:
            self._wraps += 1
        self._last_us = time_us
        return (self._wraps * WRAP_US + time_us) * 1e-6
