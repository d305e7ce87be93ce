"""One GO or TURN, from its checks to the event that ends it."""

from __future__ import annotations

import asyncio
import logging

from labmate.base.checks import BaseSnapshot, Kind, MotionReport, check_free_way, travelled
from labmate.base.readings import Readings, later
from labmate.driver import messages as m
from labmate.driver.connection import Connection
from labmate.driver.messages import BaseEvent, Bumper, Ending, Flags, Mode
from labmate.errors import BatteryLow, MotionStopped, out_of_reach
from labmate.odometry import Pose
from medusa.errors import CommandError, DeviceRestarted, MedusaError, NoReply, PortError, ProtocolError

_LOG = logging.getLogger(__name__)

_EVENT_PATIENCE = 1.0
"""A base at rest that has not told the end of its motion in this time (s) lost the event: it is sent six times
within 0.5 s."""


class Travel:
    """A GO (m) or TURN (rad) of one base. `run` it once; whoever abandons it stops the base."""

    def __init__(
        self, kind: Kind, commanded: float, connection: Connection, readings: Readings, poll_period: float
    ) -> None:
        self.kind = kind
        self.commanded = commanded
        self.may_move = False
        """Whether the base was told to move: from the first byte of the command to its reported end."""
        self._direction = (commanded, 0.0) if kind == "GO" else (0.0, commanded)
        self._operation = m.GO if kind == "GO" else m.TURN
        self._payload = m.Go(commanded).encode() if kind == "GO" else m.Turn(commanded).encode()
        self._connection = connection
        self._readings = readings
        self._poll_period = poll_period
        self._done: asyncio.Future[BaseEvent] = asyncio.get_running_loop().create_future()
        self._after_us = 0
        self._bumper = Bumper(0)

    async def run(self) -> MotionReport:
        """Travel to the end; raises CommandError (did not begin) or MotionStopped (did not arrive)."""
        loop = asyncio.get_running_loop()
        start = await self._readings.patient_snapshot()
        self._refuse(start)
        self._after_us = start.device_time_us
        begun = loop.time()
        await self._send()
        event = await self._await_end()
        self.may_move = False
        try:
            ending = Ending(event.detail)
        except ValueError:
            raise ProtocolError(f"{self.kind} ended with detail {event.detail}, known are 0–5") from None
        end = Pose(event.x, event.y, event.heading)
        way = travelled(self.kind, start.pose, end)
        report = MotionReport(
            self.kind, self.commanded, way, ending, self._bumper, start.pose, end, loop.time() - begun
        )
        await self._readings.patient_snapshot()
        if ending is not Ending.REACHED:
            raise MotionStopped(str(report), reason=report.reason, report=report)
        return report

    def take_event(self, operation: int, content: BaseEvent) -> None:
        """Hear an event of the base."""
        if not later(content.time_us, self._after_us):
            # The end of an earlier motion, told late by a repeat.
            return
        if operation == m.EVENT_BUMPER:
            self._bumper |= Bumper(content.detail)
        elif operation == m.EVENT_MOTION_DONE and not self._done.done():
            self._done.set_result(content)

    def fail(self, error: MedusaError) -> None:
        """End it: the base is heard no more, or has forgotten it."""
        if not self._done.done():
            self._done.set_exception(error)
            # Seen by whoever waits; nobody may, while the command itself is still under way.
            self._done.exception()

    def _refuse(self, start: BaseSnapshot) -> None:
        """Say in words what the base would answer with a number."""
        check_free_way(self.kind, start.flags, *self._direction)
        if start.mode is not Mode.IDLE:
            raise CommandError(
                f"{self.kind}: the base is in mode {start.mode.name}, it must be idle", status=11
            )
        if self.kind == "GO" and start.flags & Flags.BATTERY_LOW:
            raise BatteryLow(
                f"GO: the battery is low ({start.battery:.1f} V); turn, drive and stop still work", status=6
            )

    async def _send(self) -> None:
        self.may_move = True
        try:
            await self._connection.request(self._operation, self._payload)
        except CommandError as error:
            self.may_move = False
            if error.status in (8, 9):
                # Pressed or latched since the last reading.
                check_free_way(self.kind, (await self._readings.snapshot()).flags, *self._direction)
            raise

    async def _await_end(self) -> BaseEvent:
        loop = asyncio.get_running_loop()
        idle_since: float | None = None
        while True:
            await asyncio.wait((self._done,), timeout=self._poll_period)
            if self._done.done():
                return self._done.result()
            try:
                snapshot = await self._readings.snapshot()
            except (PortError, DeviceRestarted) as error:
                self.fail(out_of_reach(error))
                continue
            except NoReply as error:
                # One unlucky reading; a silent line is told by the connection.
                _LOG.warning("%s: %s", self.kind, error)
                continue
            if not snapshot.at_rest:
                idle_since = None
            elif idle_since is None:
                idle_since = loop.time()
            elif loop.time() - idle_since > _EVENT_PATIENCE:
                raise ProtocolError(f"{self.kind} ended without the event that says why; the base stands")
