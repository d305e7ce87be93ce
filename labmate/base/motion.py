"""Steering with DRIVE: a command lives as long as the task that gave it, and never long.

Three deadlines lie inside each other. The device lets a DRIVE run out after 300 ms. The feeder renews it every
100 ms, but only while the owner's task lives and for `hold` after the owner last said something. Whatever
stops the base (bumper, emergency stop, stall, watchdog, a lost line, a restart, STOP) takes the steering away
for good: a new one has to be asked for.
"""

from __future__ import annotations

import asyncio
import logging
from types import TracebackType
from typing import TYPE_CHECKING, Self

from labmate.base.checks import MAX_VALID, BaseSnapshot, check_drive
from labmate.errors import MotionStopped
from medusa.errors import CommandError, MedusaError

if TYPE_CHECKING:
    from labmate.base.mobile_base import Base

_LOG = logging.getLogger(__name__)

RENEW_PERIOD = 0.1


class Steering:
    """`async with base.steer() as steering: steering.set(speed, turn_rate)`; leaving it stops the base."""

    def __init__(self, base: Base, hold: float) -> None:
        if not RENEW_PERIOD <= hold <= 2.0:
            raise CommandError(f"a steering command may be held for {RENEW_PERIOD} to 2 s, not {hold} s")
        self._base = base
        self._hold = hold
        self._command: tuple[float, float] | None = None
        self._given_at = 0.0
        self._changed = asyncio.Event()
        self._failure: MedusaError | None = None
        self._told = False
        self._feeder: asyncio.Task[None] | None = None
        self._owner: asyncio.Task[object] | None = None

    async def __aenter__(self) -> Self:
        self._owner = asyncio.current_task()
        self._base.begin_steering(self)
        self._feeder = asyncio.get_running_loop().create_task(self._feed())
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        if self._feeder is not None:
            self._feeder.cancel()
        self._base.end_steering(self)
        try:
            await self._base.stop()
        except MedusaError:
            # A lost line says so by itself; what took the steering away is the better story.
            if self._failure is None and (error is None or isinstance(error, asyncio.CancelledError)):
                raise
            _LOG.warning("the stop after steering was not confirmed", exc_info=True)
        if self._failure is not None and error is None and not self._told:
            raise self._failure

    @property
    def failure(self) -> MedusaError | None:
        """What took the steering away, None while it is ours."""
        return self._failure

    def set(self, speed: float, turn_rate: float, by: BaseSnapshot | None = None) -> None:
        """Drive at `speed` (m/s) and `turn_rate` (rad/s) from now on, for at most `hold` s.

        `by`: the snapshot that the command was computed from. Raises StalePose when it is older than 200 ms,
        CommandError over the limits (the last command then runs out), and what took the steering away.
        """
        if self._failure is not None:
            self._told = True
            raise self._failure
        now = asyncio.get_running_loop().time()
        try:
            if by is not None:
                by.require_fresh(now)
            check_drive(self._base.limits, speed, turn_rate, MAX_VALID)
        except MedusaError:
            self._command = None
            raise
        self._command = (speed, turn_rate)
        self._given_at = now
        self._changed.set()

    def revoke(self, failure: MedusaError) -> None:
        """Take the steering away: nothing is renewed any more and every later `set` raises this."""
        if self._failure is None:
            self._failure = failure
            self._command = None
            self._changed.set()

    async def _feed(self) -> None:
        loop = asyncio.get_running_loop()
        while self._failure is None and not (self._owner is not None and self._owner.done()):
            self._changed.clear()
            if self._command is not None and loop.time() - self._given_at > self._hold:
                _LOG.warning("no steering command for %.2f s: the base runs out", self._hold)
                self._command = None
            if self._command is not None:
                try:
                    await self._base.drive(*self._command, steering=self)
                except MedusaError as error:
                    stopped = MotionStopped(f"steering ended: {error}", reason="refused")
                    stopped.__cause__ = error
                    self.revoke(error if isinstance(error, MotionStopped) else stopped)
                    return
            try:
                async with asyncio.timeout(RENEW_PERIOD):
                    await self._changed.wait()
            except TimeoutError:
                continue
