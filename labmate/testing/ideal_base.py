"""A base without errors, for pure laws in virtual time, and as the shortest example of a driver.

Every exchange takes half a millisecond. Disturb its `machine`, or the wire: `unplug`, `deaf`, `mute`.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from math import inf, radians
from typing import TypeVar

from labmate.base.checks import check_free_way
from labmate.base.driver import BaseDriver, Capabilities, Limits
from labmate.base.events import Bumper, Cause, Stopped
from labmate.base.feeding import keep_fed
from labmate.base.reading import BaseReading
from labmate.odometry import Covariance
from labmate.testing.ideal_machine import IdealMachine
from medusa.errors import DeviceRestarted, NoReply, PortError
from medusa.link.contact import Contact, seconds_suspended

T = TypeVar("T")

LIMITS = Limits(0.3, radians(30.0), 0.25, radians(60.0))
_ON_THE_WAY = 0.25e-3
_PATIENCE = 0.1
_EXACT: Covariance = ((0.0, 0.0, 0.0), (0.0, 0.0, 0.0), (0.0, 0.0, 0.0))
_LATCHES = frozenset({Cause.EMERGENCY_STOP, Cause.STALLED})


class IdealBase(BaseDriver):
    """The driver of an ideal machine, which it brings along unless one is given."""

    def __init__(
        self,
        machine: IdealMachine | None = None,
        limits: Limits = LIMITS,
        *,
        watchdog: float = 0.5,
        suspended: Callable[[], float] = seconds_suspended,
    ) -> None:
        can = Capabilities(
            watchdog=watchdog,
            expires=0.3,
            travels=False,
            twist_step=(0.0, 0.0),
            arrival=(1e-3, radians(0.1)),
            lag=0.0,
            notice=2.0 * _ON_THE_WAY,
            latch="host",
            bumpers=Bumper.FRONT | Bumper.REAR,
        )
        super().__init__("the ideal base", limits, can)
        self.machine = machine or IdealMachine(limits)
        self.machine.report = self._report
        self.plugged, self.deaf, self.mute = True, False, False
        self._contact = Contact(self.name, suspended)
        self._keeper: asyncio.Task[None] | None = None
        self._watch: asyncio.TimerHandle | None = None

    async def open(self) -> None:
        loop, watchdog = asyncio.get_running_loop(), self.can.watchdog
        await self._exchange(self._new_session)
        self._contact.reset()
        sent = self._contact.time(loop.time())
        await self._exchange(lambda: self.machine.set_watchdog(watchdog))
        self._contact.arm(watchdog, sent)
        if self._keeper is None:
            feed = keep_fed(watchdog, lambda: self._contact.unfed(loop.time()), self.read)
            self._keeper = loop.create_task(feed)

    async def close(self, *, at_rest: bool) -> None:
        if self._keeper is not None:
            self._keeper.cancel()
            self._keeper = None
        if at_rest:
            await self._exchange(lambda: self.machine.set_watchdog(inf))

    async def read(self) -> BaseReading:
        asked_at = asyncio.get_running_loop().time()
        return await self._exchange(lambda: self._reading(asked_at))

    async def twist(self, speed: float, turn_rate: float, valid: float) -> None:
        def drive() -> None:
            check_free_way("DRIVE", self._reading(self.machine.now), speed, turn_rate)
            self.machine.drive(speed, turn_rate, valid)

        await self._exchange(drive, moves=True)

    async def stop(self) -> None:
        await self._exchange(self.machine.ramp_down)

    async def emergency_stop(self) -> None:
        await self._exchange(lambda: self.machine.happen(Cause.EMERGENCY_STOP))
        self.latched.add(Cause.EMERGENCY_STOP)

    async def clear(self) -> None:
        await self._exchange(self._clear)

    def unplug(self) -> None:
        """Pull the cable."""
        self.plugged = False
        self.publish(Stopped.lost(PortError(self.name, "the port has vanished")))

    async def _exchange(self, act: Callable[[], T], *, moves: bool = False) -> T:
        loop = asyncio.get_running_loop()
        sent = loop.time()
        gap = self._contact.look(sent)
        if gap is not None:
            self.publish(Stopped.lost(gap))
        refusal = self._contact.refusal() if moves else None
        if refusal is not None:
            raise refusal
        if not self.plugged:
            raise PortError(self.name, "the port has vanished")
        await asyncio.sleep(_PATIENCE if self.deaf else _ON_THE_WAY)
        if self.deaf:
            raise NoReply(f"{self.name}: no answer")
        # It arrived then, also when this loop was away meanwhile.
        self.machine.advance(sent + _ON_THE_WAY)
        if not self.machine.in_session and act != self._new_session:
            lost = DeviceRestarted(f"{self.name} has restarted")
            self.publish(Stopped.lost(lost))
            raise lost
        self.machine.feed()
        done = act()
        self._wake_at_its_watchdog()
        await asyncio.sleep(_ON_THE_WAY)
        self._contact.answered(self._contact.time(sent))
        return done

    def _new_session(self) -> None:
        self.machine.in_session = True
        self.machine.set_watchdog(inf)
        self.machine.halt()

    def _clear(self) -> None:
        self.latched = {Cause.EMERGENCY_STOP} if self.machine.button else set()

    def _reading(self, asked_at: float) -> BaseReading:
        machine = self.machine
        return BaseReading(
            time=asked_at,
            stamp=machine.now,
            own_pose=machine.pose,
            pose=machine.pose,
            covariance=_EXACT,
            speed=machine.forward.value,
            turn_rate=machine.turning.value,
            at_rest=machine.at_rest,
            touching=machine.touching,
            latched=frozenset(self.latched),
        )

    def _report(self, event: Stopped) -> None:
        """An event of the machine, on its way to the host."""
        if self.plugged and not self.mute:
            asyncio.get_running_loop().call_later(_ON_THE_WAY, self._take_event, event)

    def _take_event(self, event: Stopped) -> None:
        self.latched |= {event.cause} & _LATCHES
        self.publish(event)

    def _wake_at_its_watchdog(self) -> None:
        if self._watch is not None:
            self._watch.cancel()
        if self.machine.watchdog_due < inf:
            loop, due = asyncio.get_running_loop(), self.machine.watchdog_due
            self._watch = loop.call_at(due, self.machine.advance, due)
