"""Virtual time: an event loop whose clock jumps to the next timer instead of waiting for it.

The selector is poll: for a tty it flushes the input queue before it answers, so a byte already written to a
pseudo-tty is always seen before the clock moves. With epoll the clock would run past it.
"""

import asyncio
import selectors
import time
from collections.abc import Coroutine
from math import inf, nextafter
from typing import Any, TypeVar

T = TypeVar("T")

_LEAST_RESOLUTION = 1e-9


class _JumpingSelector(selectors.PollSelector):
    """Answers at once: with what is ready, or by moving its loop's clock to the next timer."""

    def __init__(self) -> None:
        super().__init__()
        self.loop: VirtualTimeLoop | None = None

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        ready = super().select(0)
        if ready or timeout is None or timeout <= 0 or self.loop is None:
            # No timer at all: only a signal, a thread or another process can go on, so wait for it.
            return super().select(None) if not ready and timeout is None else ready
        self.loop.jump(timeout)
        return ready


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An event loop in virtual time from 0.0 s: deterministic, and as fast as the computing in it.

    Work in threads and in other processes takes no virtual time that the loop could know of: timers
    overtake it.
    """

    def __init__(self) -> None:
        selector = _JumpingSelector()
        self._now = 0.0
        super().__init__(selector)
        selector.loop = self

    def time(self) -> float:
        return self._now

    def jump(self, timeout: float) -> None:
        """Move the clock to the next timer, `timeout` seconds on."""
        scheduled: list[asyncio.TimerHandle] = self._scheduled  # type: ignore[attr-defined]
        # The timer's own time: now + (when − now) may miss it by a rounding.
        target = scheduled[0].when() if scheduled else self._now + timeout
        if target + _LEAST_RESOLUTION == target:
            # After months a double's steps exceed the loop's resolution, and it would never call this timer.
            target = nextafter(target, inf)
        self._now = max(self._now, target)


class _ScaledSelector(selectors.DefaultSelector):
    """Waits `speed` times shorter than it is asked to."""

    def __init__(self, speed: float) -> None:
        super().__init__()
        self._speed = speed

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        return super().select(None if timeout is None else timeout / self._speed)


class ScaledTimeLoop(asyncio.SelectorEventLoop):
    """An event loop on the wall clock, whose seconds pass `speed` times as fast."""

    def __init__(self, speed: float) -> None:
        self._speed = speed
        self._start = time.monotonic()
        super().__init__(_ScaledSelector(speed))
        if not speed > 0:
            self.close()
            raise ValueError(f"speed is {speed}, must be above 0")

    def time(self) -> float:
        return (time.monotonic() - self._start) * self._speed


def run_virtual(main: Coroutine[Any, Any, T]) -> T:
    """Run a coroutine to its end in virtual time, on a fresh loop that is closed afterwards."""
    with asyncio.Runner(loop_factory=VirtualTimeLoop) as runner:
        return runner.run(main)
