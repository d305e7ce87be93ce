"""One GO or TURN that the base drives by itself, from its checks to the event that ends it."""

from __future__ import annotations

import asyncio
import logging

from labmate.base.checks import check_travel
from labmate.base.driver import BaseDriver, Kind
from labmate.base.events import UNTOUCHED, Cause, Event, Stopped, TravelEnded
from labmate.base.readings import Readings
from labmate.base.report import MotionReport, travelled
from labmate.errors import MotionStopped
from medusa.errors import CommandError, DeviceRestarted, MedusaError, NoReply, PortError, ProtocolError

log = logging.getLogger(__name__)

_EVENT_PATIENCE = 1.0
"""A base at rest that has not reported the end of its motion in this time (s) lost the event."""


class Travel:
    """A GO (m) or TURN (rad) of one base. `run` it once; whoever abandons it stops the base."""

    def __init__(
        self, kind: Kind, commanded: float, driver: BaseDriver, readings: Readings, poll_period: float
    ) -> None:
        self.kind: Kind = kind
        self.commanded = commanded
        self.may_move = False
        """Whether the base may be travelling: from the first byte of the command to its reported end."""
        self._direction = (commanded, 0.0) if kind == "GO" else (0.0, commanded)
        self._driver = driver
        self._readings = readings
        self._poll_period = poll_period
        self._end: asyncio.Future[TravelEnded] = asyncio.get_running_loop().create_future()
        self._interrupted: MotionStopped | None = None
        self._after = 0.0
        self._touched = UNTOUCHED

    async def run(self) -> MotionReport:
        """Travel to the end; raises CommandError (did not begin) or MotionStopped (did not arrive)."""
        loop = asyncio.get_running_loop()
        start = await self._readings.read_patiently()
        check_travel(self.kind, start, *self._direction)
        self._after = start.stamp
        begun = loop.time()
        await self._begin()
        ended = await self._await_end()
        self.may_move = False
        report = MotionReport(
            self.kind,
            self.commanded,
            travelled(self.kind, start.own_pose, ended.pose),
            ended.cause,
            self._touched,
            start.own_pose,
            ended.pose,
            loop.time() - begun,
        )
        await self._readings.read_patiently()
        if ended.cause is not Cause.REACHED:
            raise MotionStopped(str(report), reason=report.reason, report=report)
        return report

    def take_event(self, event: Event) -> None:
        """Take in what the base reports; the end of an earlier motion may be reported late, by a repeat."""
        if event.stamp <= self._after:
            return
        if isinstance(event, Stopped):
            self._touched |= event.touching
        elif isinstance(event, TravelEnded) and not self._end.done():
            self._end.set_result(event)

    def stop_called(self, error: MotionStopped) -> None:
        """Do not begin any more; a base that travels reports by itself how the stop ended it."""
        self._interrupted = error
        if not self.may_move:
            self.fail(error)

    def fail(self, error: MotionStopped) -> None:
        """End it: the base is read no more, has forgotten it, or must not begin."""
        self._interrupted = error
        if not self._end.done():
            self._end.set_exception(error)
            # Retrieved by whoever waits; nobody may, while the command itself is still under way.
            self._end.exception()

    async def _begin(self) -> None:
        if self._end.done():
            self._end.result()
        self.may_move = True
        try:
            await self._driver.travel(self.kind, self.commanded)
        except CommandError:
            self.may_move = False
            raise
        except MedusaError as error:
            if self._interrupted is not None:
                # Withdrawn for a stop, or lost: that is what ended it.
                raise self._interrupted from error
            raise

    async def _await_end(self) -> TravelEnded:
        loop = asyncio.get_running_loop()
        idle_since: float | None = None
        while True:
            await asyncio.wait((self._end,), timeout=self._poll_period)
            if self._end.done():
                return self._end.result()
            try:
                reading = await self._readings.read()
            except (PortError, DeviceRestarted) as error:
                self.fail(Stopped.lost(error).ending())
                continue
            except NoReply as error:
                # One unlucky reading; a silent line is reported by the driver.
                log.warning("%s: %s", self.kind, error)
                continue
            if not reading.at_rest:
                idle_since = None
            elif idle_since is None:
                idle_since = loop.time()
            elif loop.time() - idle_since > _EVENT_PATIENCE:
                raise ProtocolError(f"{self.kind} ended without the event that says why; the base is at rest")
