"""The head as one machine: named joints in radians over a drive, with what is the same for every drive."""

import asyncio
import logging
import math
from collections.abc import AsyncIterator, Callable, Collection, Iterable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Self

from medusa.completion import run_to_completion
from medusa.errors import CommandError, MedusaError
from medusa.head.drive import Capabilities, Drive, Homed, JointTraits, Reading, Speeds
from medusa.head.fault_reaction import FaultReaction
from medusa.head.faults import Cause, Fault
from medusa.head.moves import MoveReport, Moves
from medusa.head.soft_limits import check_angle, check_speed
from medusa.head.stopping import Stopping
from medusa.head.velocity_guard import VelocityGuard

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Rates:
    """Rates (rad/s) as the machine took them; `limited` joints have none, being too near to a soft limit."""

    taken: dict[str, float]
    limited: frozenset[str]


class JointGroup:
    """A head over an open drive; `JointGroup.open` makes one. Connecting, reconnecting and failing move nothing."""

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self._stopping = Stopping(drive)
        self._guard = VelocityGuard(drive)
        self._reaction = FaultReaction(drive, self._stopping, self._guard.forget)
        self._moves = Moves(drive, self.stop, self._reaction.stopped)

    @property
    def traits(self) -> Mapping[str, JointTraits]:
        """By joint what it may do."""
        return self.drive.traits

    @property
    def can(self) -> Capabilities:
        """What the machine can do and how exactly."""
        return self.drive.can

    @property
    def enabled(self) -> frozenset[str]:
        """Joints that this host has enabled."""
        return self.drive.enabled

    @classmethod
    @asynccontextmanager
    async def open(cls, drive: Drive) -> AsyncIterator[Self]:
        """Connect to a machine, and leave it stopped and disabled at the end, however often that is cancelled.

        Raises what the drive's line raises; at the end DeviceFault when the head cannot be confirmed at rest.
        """
        group = cls(drive)
        try:
            await drive.open()
            yield group
        except BaseException as ended:
            # What ended the context is raised; what then kept the head from being confirmed at rest, as its note.
            try:
                await run_to_completion(group._close())
            except MedusaError as error:
                log.error("%s", error)
                if str(error) not in str(ended):
                    ended.add_note(f"the head could not be confirmed at rest: {error}")
            raise
        else:
            await run_to_completion(group._close())

    async def _close(self) -> None:
        try:
            if self.enabled:
                await self.stop()
                await self.disable()
        finally:
            await self._guard.end()
            self._reaction.close()
            await self.drive.close()

    async def enable(self, names: Iterable[str] | None = None) -> None:
        """Take joints (default: all) under control where they are.

        Raises DeviceFault naming the joint that cannot be enabled, CommandError while something is latched.
        """
        await self.drive.enable(self._known(names))

    async def disable(self, names: Iterable[str] | None = None) -> None:
        """Bring joints to rest by their ramps and let go of them.

        Raises DeviceFault naming the joints that do not come to rest.
        """
        wanted = [name for name in self._known(names) if name in self.enabled]
        if self._moves.is_running(wanted):
            await self.stop()
        await self.drive.disable(wanted)

    async def home(self, names: Iterable[str] | None = None) -> Mapping[str, Homed]:
        """Make the angles of joints (default: all) known, in the machine's own way."""
        return await self.drive.home(self._known(names), self)

    async def read(self) -> Reading:
        """The state of all joints now."""
        reading = await self.drive.read()
        self._guard.take_reading(reading)
        return reading

    async def readings(self, rate_hz: float) -> AsyncIterator[Reading]:
        """The state of all joints at a fixed rate against absolute deadlines; one that is late is not made up for."""
        if not 0 < rate_hz <= 1000:
            raise CommandError(f"a rate of {rate_hz:g} Hz is not in (0, 1000] Hz")
        loop = asyncio.get_running_loop()
        period = 1 / rate_hz
        due = loop.time()
        while True:
            yield await self.read()
            due = max(due + period, loop.time())
            await asyncio.sleep(due - loop.time())

    async def move(
        self,
        targets: Mapping[str, float],
        speeds: Mapping[str, Speeds] | None = None,
        *,
        together: bool = False,
    ) -> MoveReport:
        """Move joints to angles (rad) and wait until they are at rest; `together`: they arrive at once. See `Moves`."""
        self._known(targets)
        return await self._moves.run(targets, speeds or {}, together=together)

    async def move_to(self, targets: Mapping[str, float]) -> Reading:
        """Move joints to angles (rad); the reading at the end."""
        return (await self.move(targets)).reading

    async def drive_rates(self, rates: Mapping[str, float]) -> Rates:
        """Turn joints at rates (rad/s) from now on; one that could not end before its soft limit gets none.

        Raises CommandError for a joint that is idle or not homed, or a rate over its speed.
        """
        return await self._set_rates(rates, await self._without_margin(rates))

    async def velocity(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Turn joints at rates (rad/s) from now on; the rates taken. CommandError also at a soft limit: all or none."""
        limited = await self._without_margin(rates)
        for name in rates:
            if name in limited:
                limit = self._guard.limit_ahead(name, rates[name])
                raise CommandError(
                    f"{name}: a velocity of {math.degrees(rates[name]):.2f}°/s cannot stop any more before the"
                    f" soft limit of {math.degrees(limit):.2f}°"
                )
        return (await self._set_rates(rates, limited)).taken

    async def _without_margin(self, rates: Mapping[str, float]) -> frozenset[str]:
        for name in self._known(rates):
            check_speed(name, rates[name], self.traits[name])
        return await self._guard.without_margin(rates)

    async def _set_rates(self, rates: Mapping[str, float], limited: frozenset[str]) -> Rates:
        asked = {name: 0.0 if name in limited else rate for name, rate in rates.items()}
        # Watched first: a command whose reply is lost may have acted.
        self._guard.take_rates(asked)
        taken = await self.drive.set_rates(asked)
        self._guard.take_rates(taken)
        return Rates(taken, limited)

    async def step(self, angles: Mapping[str, float]) -> None:
        """Step joints (rad) without a profile: a microsaccade. A rate ends by its ramp first.

        Raises CommandError outside the soft limits, or for a step that the machine does not take.
        """
        for name in self._known(angles):
            check_angle(name, angles[name], self.traits[name])
        await self.drive.step(angles)

    async def stop(self) -> None:
        """Stop every joint by its ramp, confirmed by reading back; DeviceFault names what is not."""
        self._moves.interrupt("the head was stopped on the way")
        self._guard.forget()
        await self._stopping.stop()

    async def emergency_stop(self) -> None:
        """Stop everything at once and latch it, confirmed by reading back; `clear` releases it."""
        self._moves.interrupt("the head was stopped on the way by an emergency stop")
        self._guard.forget()
        self._reaction.emergency = True
        await self._stopping.emergency_stop()

    async def clear(self) -> dict[str, frozenset[Cause]]:
        """Release what is latched and whose cause is gone; by joint what remains. Moves nothing."""
        self._moves.forget_armed()
        await self.drive.clear()
        self._reaction.emergency = False
        return {name: joint.latched for name, joint in (await self.read()).joints.items() if joint.latched}

    async def rest(self, names: Iterable[str] | None = None) -> None:
        """Wait until joints (default: all) are at rest; DeviceFault names those that are not in time."""
        await self._stopping.rest(self._known(names))

    async def park(self) -> MoveReport:
        """Move to the park angles, then let go of all joints."""
        report = await self.move({name: traits.park for name, traits in self.traits.items()})
        await self.disable()
        return report

    def subscribe(self, listener: Callable[[Fault], None]) -> Callable[[], None]:
        """Call back for each fault; returns what ends the subscription."""
        return self.drive.subscribe(listener)

    async def faults(self) -> AsyncIterator[Fault]:
        """Every fault from now on."""
        queue: asyncio.Queue[Fault] = asyncio.Queue()
        end = self.subscribe(queue.put_nowait)
        try:
            while True:
                yield await queue.get()
        finally:
            end()

    async def stopped_by_fault(self) -> str:
        """Wait until the stop that the last fault caused has ended; what there is to report of it."""
        return await self._reaction.stopped()

    def _known(self, names: Collection[str] | Iterable[str] | None) -> list[str]:
        chosen = list(self.traits if names is None else names)
        for name in chosen:
            if name not in self.traits:
                raise CommandError(f"there is no joint {name!r}; the head has {', '.join(self.traits)}")
        return chosen
