"""Virtual time: an event loop whose clock jumps to the next timer instead of waiting for it.

The selector is poll: for a tty it flushes the input queue before it answers, so a byte already written to a
pseudo-tty is always seen before the clock moves. With epoll the clock would run past it.
"""

import asyncio
import select
import selectors
import time
from collections.abc import Coroutine
from math import inf, nextafter
from typing import TYPE_CHECKING, Any, Protocol, TypeVar

if TYPE_CHECKING:
    from _typeshed import FileDescriptorLike

T = TypeVar("T")

_LEAST_RESOLUTION = 1e-9
_STEPS_BETWEEN_POLLS = 64


class Stepper(Protocol):
    """Something that runs between the timers of a virtual loop, without timers of its own."""

    def next_step(self) -> float:
        """Return when it wants to run next; infinity: not."""

    def step(self, now: float) -> None:
        """Run at its time. It may set timers, but not call anything back."""


class _JumpingSelector(selectors.PollSelector):
    """Answers at once: with what is ready, or by moving its loop's clock to the next timer."""

    def __init__(self) -> None:
        super().__init__()
        self.loop: VirtualTimeLoop | None = None
        # Asks only whether anything is ready: most often nothing is, and the answer costs less.
        self._probe = select.poll()

    def register(self, fileobj: "FileDescriptorLike", events: int, data: Any = None) -> selectors.SelectorKey:
        key = super().register(fileobj, events, data)
        self._probe.register(key.fd, _poll_mask(events))
        return key

    def modify(self, fileobj: "FileDescriptorLike", events: int, data: Any = None) -> selectors.SelectorKey:
        key = super().modify(fileobj, events, data)
        self._probe.modify(key.fd, _poll_mask(events))
        return key

    def unregister(self, fileobj: "FileDescriptorLike") -> selectors.SelectorKey:
        key = super().unregister(fileobj)
        self._probe.unregister(key.fd)
        return key

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if self._probe.poll(0):
            return super().select(0)
        if timeout is not None and timeout <= 0:
            return []
        if self.loop is not None and self.loop.jump():
            return []
        # No timer at all: only a signal, a thread or another process can go on, so wait for it.
        return super().select(timeout)


def _poll_mask(events: int) -> int:
    mask = select.POLLIN if events & selectors.EVENT_READ else 0
    return mask | select.POLLOUT if events & selectors.EVENT_WRITE else mask


class VirtualTimeLoop(asyncio.SelectorEventLoop):
    """An event loop in virtual time from 0.0 s: deterministic, and as fast as the computing in it.

    Work in threads and in other processes takes no virtual time that the loop could know of: timers
    overtake it.
    """

    def __init__(self) -> None:
        selector = _JumpingSelector()
        self._now = 0.0
        self._steppers: list[Stepper] = []
        super().__init__(selector)
        selector.loop = self

    def time(self) -> float:
        return self._now

    def block(self, seconds: float) -> None:
        """Let time pass within the running callback, as work of its own would: nothing else runs meanwhile."""
        self._now += seconds

    def add_stepper(self, stepper: Stepper) -> None:
        """Run something between the timers, each step at its own time."""
        self._steppers.append(stepper)

    def remove_stepper(self, stepper: Stepper) -> None:
        """Run it no more."""
        self._steppers.remove(stepper)

    def jump(self) -> bool:
        """Move the clock to the next timer by way of the steps before it; False when there is neither."""
        scheduled: list[asyncio.TimerHandle] = self._scheduled  # type: ignore[attr-defined]
        for _ in range(_STEPS_BETWEEN_POLLS):
            timer = scheduled[0].when() if scheduled else inf
            step, stepper = timer, None
            for candidate in self._steppers:
                due = candidate.next_step()
                if due < step:
                    step, stepper = due, candidate
            if stepper is None:
                self._move_to(timer)
                return timer < inf
            self._now = max(self._now, step)
            stepper.step(self._now)
        return True

    def _move_to(self, timer: float) -> None:
        if timer == inf:
            return
        if timer + _LEAST_RESOLUTION == timer:
            # After months a double's steps exceed the loop's resolution, and it would never call this timer.
            timer = nextafter(timer, inf)
        self._now = max(self._now, timer)


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
