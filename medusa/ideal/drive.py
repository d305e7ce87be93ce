"""An ideal head: joints that follow their commands exactly, on a machine of its own that only hears requests.

For tests that need no chip, and for gaze at the speed of the computer. Every exchange takes time, as on a line.
"""

import asyncio
import math
from collections.abc import Callable, Collection, Mapping
from typing import TypeVar

from medusa.errors import CommandError, PortError
from medusa.head.drive import Capabilities, JointState, JointTraits, MovePlan
from medusa.head.faults import Cause
from medusa.head.polled_drive import FEEDS_PER_TIMEOUT, PolledDrive
from medusa.head.trapezoid import Motion, profile, ramp
from medusa.link.contact import seconds_suspended

T = TypeVar("T")

EXCHANGE_SECONDS = 0.0005


class IdealMachine:
    """What is on the other side: motions, a watchdog, latches. Its time is the host's, suspensions included."""

    def __init__(self, traits: Mapping[str, JointTraits], watchdog: float) -> None:
        self.traits = traits
        self.motions = {name: Motion(0.0, 0.0) for name in traits}
        self.rates = dict.fromkeys(traits, 0.0)
        self.powered: set[str] = set()
        self.latched: dict[str, frozenset[Cause]] = dict.fromkeys(traits, frozenset())
        self.plugged = True
        self._watchdog = watchdog
        self._fed = math.inf

    def receive(self, now: float) -> None:
        """A request arrives: what became due before it happens first."""
        self.advance_to(now)
        self._fed = now if self.powered else math.inf

    def advance_to(self, now: float) -> None:
        """Let the watchdog expire that nobody fed: every joint ramps to rest, and stays there."""
        due = self._fed + self._watchdog
        if now > due:
            self._fed = math.inf
            self.stop(due, self.traits)

    def angle(self, name: str, now: float) -> float:
        """Where a joint is, rad."""
        self.advance_to(now)
        return self.motions[name].at(now)[0]

    def stop(self, now: float, names: Collection[str]) -> None:
        """Ramp joints to rest."""
        for name in names:
            self._ramp(now, name, 0.0)

    def turn(self, now: float, rates: Mapping[str, float]) -> None:
        """Ramp powered joints to rates; CommandError when one is not powered, and then none."""
        self._require_power(rates)
        for name, rate in rates.items():
            self._ramp(now, name, rate)

    def _ramp(self, now: float, name: str, rate: float) -> None:
        self.motions[name] = ramp(now, *self.motions[name].at(now), rate, self.traits[name].acceleration)
        self.rates[name] = rate

    def go(self, now: float, profiles: Mapping[str, tuple[float, float, float]]) -> None:
        """Run powered joints to (target, speed, acceleration); CommandError when one is not powered, and then none."""
        self._require_power(profiles)
        for name, wanted in profiles.items():
            self.motions[name] = profile(now, *self.motions[name].at(now), *wanted)
            self.rates[name] = 0.0

    def _require_power(self, names: Collection[str]) -> None:
        for name in names:
            if name not in self.powered:
                raise CommandError(f"{name}: is idle; enable it first")

    def trip(self, now: float, names: Collection[str], cause: Cause) -> None:
        """Stop joints at once, latch why, and let go of them."""
        for name in names:
            self.motions[name] = Motion(now, self.motions[name].at(now)[0])
            self.rates[name] = 0.0
            self.latched[name] |= {cause}
            self.powered.discard(name)


class IdealDrive(PolledDrive):
    """The ideal machine as a drive; `machine` only to witness and to disturb."""

    def __init__(
        self,
        traits: Mapping[str, JointTraits],
        *,
        watchdog: float = 0.4,
        suspended: Callable[[], float] = seconds_suspended,
    ) -> None:
        super().__init__("the ideal machine", suspended)
        self.traits = dict(traits)
        self.units = (tuple(traits),)
        self.can = Capabilities(
            start_skew=0.0,
            end_skew=0.0,
            stamp_error=EXCHANGE_SECONDS,
            notice=watchdog / FEEDS_PER_TIMEOUT + 2 * EXCHANGE_SECONDS,
            watchdog=watchdog,
            keeps_limits=False,
            retargets=True,
            homing="absolute",
            emergency="limp",
            latch="device",
        )
        self.machine = IdealMachine(self.traits, watchdog)

    def now(self) -> float:
        """The machine's time, s."""
        return self.contact.time(asyncio.get_running_loop().time())

    async def open(self) -> None:
        """Connect: whatever moves, stops."""
        await self._ask(lambda now: self.machine.stop(now, self.traits))

    async def _ask(self, action: Callable[[float], T], *, moves: bool = False) -> T:
        """An exchange whose request acts at its middle."""

        async def request() -> T:
            await asyncio.sleep(EXCHANGE_SECONDS / 2)
            if not self.machine.plugged:
                raise PortError("ideal", "unplugged")
            self.machine.receive(self.now())
            done = action(self.now())
            await asyncio.sleep(EXCHANGE_SECONDS / 2)
            return done

        return await self.exchange(request, moves=moves)

    async def _power(self, names: Collection[str], on: bool) -> None:
        change = self.machine.powered.update if on else self.machine.powered.difference_update
        await self._ask(lambda now: change(names))

    async def _read(self) -> dict[str, JointState]:
        time = asyncio.get_running_loop().time() + EXCHANGE_SECONDS / 2
        return await self._ask(lambda now: {name: self._state(name, now, time) for name in self.traits})

    def _state(self, name: str, now: float, time: float) -> JointState:
        motion = self.machine.motions[name]
        position, rate = motion.at(now)
        return JointState(
            time=time,
            angle=position,
            raw=position,
            commanded=position,
            rate=self.machine.rates[name],
            moving=rate != 0 or now < motion.end or self.machine.rates[name] != 0,
            enabled=name in self.machine.powered,
            homed=True,
            latched=self.machine.latched[name],
        )

    async def _go(self, plan: MovePlan) -> None:
        wanted = {name: (target, *plan.device[name]) for name, target in plan.finals.items()}
        await self._ask(lambda now: self.machine.go(now, wanted), moves=True)

    async def set_rates(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Ramp to rates, each taken as it is."""
        await self._ask(lambda now: self.machine.turn(now, rates), moves=True)
        return dict(rates)

    async def step(self, angles: Mapping[str, float]) -> None:
        """The shortest profile there is."""
        wanted = {
            n: (angle, self.traits[n].speed, self.traits[n].acceleration) for n, angle in angles.items()
        }
        await self._ask(lambda now: self.machine.go(now, wanted), moves=True)

    async def stop(self, names: Collection[str]) -> None:
        """Ramp to rest."""
        await self._ask(lambda now: self.machine.stop(now, names))

    async def emergency_stop(self) -> None:
        """Stop at once, latch and let go."""
        await self._ask(lambda now: self.machine.trip(now, self.traits, Cause.EMERGENCY_STOP))

    async def clear(self) -> None:
        """Release every latch."""
        await self._ask(lambda now: self.machine.latched.update(dict.fromkeys(self.traits, frozenset())))
