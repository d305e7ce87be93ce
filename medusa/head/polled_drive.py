"""The shared part of drives over machines that report nothing by themselves: whoever reads, looks.

An author writes what the machine does on request (`_power`, `_read`, `_go`, `set_rates`, `step`, `stop`,
`emergency_stop`, `clear`), each through `exchange`. Here is what is the same for all: the watchdog is kept fed, a
host's gap is noticed before anything leaves, faults are published once, profiles are planned, the host remembers what
the machine does not.
"""

import asyncio
import logging
from abc import abstractmethod
from collections.abc import Awaitable, Callable, Collection, Mapping
from dataclasses import replace
from typing import TypeVar

from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.drive import Drive, Homed, JointState, MoveEnds, MovePlan, Mover, Reading, Speeds
from medusa.head.faults import Cause, Fault
from medusa.head.stopping import Stopping
from medusa.head.trapezoid import profile
from medusa.link.contact import Contact, seconds_suspended

log = logging.getLogger(__name__)

T = TypeVar("T")

FEEDS_PER_TIMEOUT = 3
POLL_SECONDS = 0.01
LATE_SECONDS = 0.5
"""A move that has not ended so long after its plan is late: the link's repeats, and the machine's own rounding."""


class PolledDrive(Drive):
    """Joints of one device that answers and never speaks first; `name` is what messages call it."""

    def __init__(self, name: str, suspended: Callable[[], float] = seconds_suspended) -> None:
        super().__init__()
        self.contact = Contact(name, suspended)
        self._enabled: frozenset[str] = frozenset()
        self._host_latched: frozenset[Cause] = frozenset()
        self._reported: dict[str, frozenset[Cause]] = {}
        self._lost = False
        self._keeper: asyncio.Task[None] | None = None

    @property
    def enabled(self) -> frozenset[str]:
        """Joints that this host has enabled."""
        return self._enabled

    @abstractmethod
    async def _power(self, names: Collection[str], on: bool) -> None:
        """Take joints under control where they are, or let go of them."""

    @abstractmethod
    async def _read(self) -> dict[str, JointState]:
        """All joints now."""

    @abstractmethod
    async def _go(self, plan: MovePlan) -> None:
        """Begin the profiles of a plan; `plan.device` has (speed, acceleration) by joint."""

    async def exchange(self, request: Callable[[], Awaitable[T]], *, moves: bool = False) -> T:
        """One request and its reply, `moves` when it can move something.

        Looked at before it leaves: after a gap longer than the watchdog nothing moves until `enable`.
        """
        loop = asyncio.get_running_loop()
        gap = self.contact.look(loop.time())
        if gap is not None:
            self._fault(Cause.WATCHDOG, str(gap))
        if moves and self.contact.gap is not None:
            raise DeviceFault(f"{self.contact.gap}; enable the joints before they move")
        sent = self.contact.time(loop.time())
        try:
            reply = await request()
        except MedusaError as error:
            if not self._lost and error.origin in ("port", "line"):
                self._lost = True
                self._fault(Cause.LOST, f"line lost: {error}")
            raise
        self._lost = False
        self.contact.answered(sent)
        return reply

    def latch(self, cause: Cause) -> None:
        """Remember a cause for a machine that does not, until `unlatch`."""
        self._host_latched |= {cause}

    def unlatch(self) -> None:
        """Forget what the host has remembered."""
        self._host_latched = frozenset()

    async def read(self, names: Collection[str] | None = None) -> Reading:
        """All joints; what is newly latched is published as a fault."""
        joints = {
            name: replace(joint, latched=joint.latched | self._host_latched)
            for name, joint in (await self._read()).items()
        }
        news: dict[Cause, list[str]] = {}
        for name, joint in joints.items():
            for cause in joint.latched - self._reported.get(name, frozenset()):
                news.setdefault(cause, []).append(name)
            self._reported[name] = joint.latched
        for cause, concerned in news.items():
            self._fault(cause, cause.value, tuple(concerned))
        return Reading(min(joint.time for joint in joints.values()), joints)

    async def enable(self, names: Collection[str]) -> None:
        """Power joints on, unless something is latched, and keep the watchdog fed from now on."""
        for name, joint in (await self.read()).joints.items():
            if name in names and joint.latched:
                causes = " and ".join(sorted(cause.value for cause in joint.latched))
                raise CommandError(f"{name}: {causes} is latched; clear it first")
        self.contact.reset()
        self._enabled |= frozenset(names)
        sent = self.contact.time(asyncio.get_running_loop().time())
        await self._power(names, True)
        if self.can.watchdog is not None:
            self.contact.arm(self.can.watchdog, sent)
        if self._keeper is None:
            self._keeper = asyncio.get_running_loop().create_task(self._keep(), name="feed and poll")

    async def disable(self, names: Collection[str]) -> None:
        """Stop joints, wait for rest, power them off."""
        wanted = [name for name in names if name in self._enabled]
        if wanted:
            await self.stop(wanted)
            await Stopping(self).rest(wanted)
            await self._power(wanted, False)
        self._enabled -= frozenset(wanted)
        if not self._enabled:
            self.contact.disarm()
            await self._end_keeping()

    async def close(self) -> None:
        """Feed no longer."""
        await self._end_keeping()

    async def home(self, names: Collection[str], mover: Mover) -> Mapping[str, Homed]:
        """Angles are known from the start: there is nothing to search."""
        await self.enable([name for name in names if name not in self._enabled])
        joints = (await self.read()).joints
        return {name: Homed(name, joints[name].angle, 0.0) for name in names}

    def plan(
        self,
        reading: Reading,
        targets: Mapping[str, float],
        speeds: Mapping[str, Speeds],
        *,
        together: bool = False,
    ) -> MovePlan:
        """Trapezoids from the present command; `together`: those that are shorter by k run at v/k and a/k²."""
        chosen: dict[str, tuple[float, float]] = {}
        for name in targets:
            traits, wanted = self.traits[name], speeds.get(name, Speeds())
            chosen[name] = (wanted.max_speed or traits.speed, wanted.acceleration or traits.acceleration)
        seconds = {name: self._seconds(reading, name, targets[name], *chosen[name]) for name in targets}
        longest = max(seconds.values(), default=0.0)
        if together:
            for name, own in seconds.items():
                if own > 0:
                    (speed, acceleration), slower = chosen[name], longest / own
                    chosen[name] = (speed / slower, acceleration / slower**2)
            seconds = {name: longest if own > 0 else 0.0 for name, own in seconds.items()}
        return MovePlan(
            targets=dict(targets),
            finals=dict(targets),
            seconds=seconds,
            peak_speeds={name: self._peak(reading, name, targets[name], *chosen[name]) for name in targets},
            device=chosen,
        )

    async def arm(self, plan: MovePlan) -> None:
        """Nothing is sent before the start: a machine without events needs no armed move."""

    async def run(self, plan: MovePlan) -> MoveEnds:
        """Begin the profiles, and look until they have ended."""
        loop = asyncio.get_running_loop()
        started = loop.time()
        await self._go(plan)
        end = started + plan.duration
        while True:
            await asyncio.sleep(max(POLL_SECONDS, end - loop.time()))
            joints = (await self.read(plan.finals)).joints
            late = [name for name in plan.finals if joints[name].moving]
            if not late:
                return MoveEnds(
                    dict.fromkeys(plan.finals, started),
                    {name: started + seconds for name, seconds in plan.seconds.items()},
                )
            if loop.time() > end + LATE_SECONDS:
                names = ", ".join(late)
                raise DeviceFault(f"{names}: still moving {plan.duration:.2f} s after the start", axis=names)

    def _seconds(
        self, reading: Reading, name: str, target: float, speed: float, acceleration: float
    ) -> float:
        joint = reading.joints[name]
        motion = profile(0.0, joint.commanded, joint.rate, target, speed, acceleration)
        return motion.end

    def _peak(self, reading: Reading, name: str, target: float, speed: float, acceleration: float) -> float:
        distance = abs(target - reading.joints[name].commanded)
        return float(min(speed, (acceleration * distance) ** 0.5))

    def _fault(self, cause: Cause, reason: str, joints: tuple[str, ...] | None = None) -> None:
        now = asyncio.get_running_loop().time()
        self.publish(Fault(cause, tuple(self.traits) if joints is None else joints, reason, now))

    async def _keep(self) -> None:
        """Every reading feeds the watchdog, and shows what the machine has latched."""
        period = (self.can.watchdog or LATE_SECONDS) / FEEDS_PER_TIMEOUT
        while True:
            await asyncio.sleep(period)
            try:
                await self.read()
            except MedusaError as error:
                log.debug("not read: %s", error)

    async def _end_keeping(self) -> None:
        keeper, self._keeper = self._keeper, None
        if keeper is not None:
            keeper.cancel()
            await asyncio.gather(keeper, return_exceptions=True)
