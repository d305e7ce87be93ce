"""The base's own clock."""

from __future__ import annotations

_WRAP = 1 << 32
_MICRO = 1e-6


class DeviceClock:
    """Turns the base's µs since power-up, which wrap after 71 minutes, into seconds that do not."""

    def __init__(self) -> None:
        self._last_us: int | None = None
        self._total_us = 0

    def seconds(self, time_us: int) -> float:
        """Return a stamp in s; one from before the latest stays before it."""
        if self._last_us is None:
            self._last_us = self._total_us = time_us
        ahead = (time_us - self._last_us + _WRAP // 2) % _WRAP - _WRAP // 2
        if ahead > 0:
            self._last_us = time_us
            self._total_us += ahead
            ahead = 0
        return (self._total_us + ahead) * _MICRO
