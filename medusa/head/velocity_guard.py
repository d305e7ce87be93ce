"""Soft limits in the velocity modes: no rate is taken up, and none goes on, that could not end before the limit."""

import asyncio
import contextlib
import logging
import math
from collections.abc import Collection, Mapping

from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.drive import Drive, JointState, Reading
from medusa.head.faults import Cause, Fault

log = logging.getLogger(__name__)

SUPERVISION_SECONDS = 0.04
"""Between the instant that a reading shows and the stop that follows from it: two requests and a timer."""
FRESH_SECONDS = 0.1
"""A joint read longer ago is read again before it is given a rate."""
LOOK_SECONDS = (0.01, 0.25)


class VelocityGuard:
    """Watches joints that have a rate, from `start` until `end`; reads them only as often as it has to."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self._latest: dict[str, JointState] = {}
        self._rates = dict.fromkeys(drive.traits, 0.0)
        self._since = -math.inf
        self._changed = asyncio.Event()
        self._task: asyncio.Task[None] | None = None

    def take_reading(self, reading: Reading) -> None:
        """Take in a reading, whoever asked for it; one from before the last stop counts for nothing."""
        for name, joint in reading.joints.items():
            if joint.time > self._since:
                self._latest[name] = joint
                if not joint.moving:
                    self._rates[name] = 0.0

    def take_rates(self, rates: Mapping[str, float]) -> None:
        """Rates (rad/s) are on their way: these joints have to be watched."""
        self._rates |= rates
        if self._drive.can.keeps_limits:
            return
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._watch(), name="velocity guard")
        self._changed.set()

    def forget(self) -> None:
        """A stop is on its way: what was read or commanded before it is invalid."""
        self._since = asyncio.get_running_loop().time()
        self._latest.clear()
        self._rates = dict.fromkeys(self._rates, 0.0)
        self._changed.set()

    async def end(self) -> None:
        """Watch no longer."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def without_margin(self, rates: Mapping[str, float]) -> frozenset[str]:
        """Joints whose rate could not end before the soft limit any more.

        Raises CommandError for a joint that is not homed: its limits cannot be kept.
        """
        if self._drive.can.keeps_limits:
            return frozenset()
        going = [name for name, rate in rates.items() if rate != 0]
        await self._refresh(going)
        for name in going:
            if not self._latest[name].homed:
                raise CommandError(f"{name}: is not homed, so its soft limits cannot be kept")
        return frozenset(name for name in going if self.stopping_margin(name, rates[name]) <= 0)

    def limit_ahead(self, name: str, rate: float) -> float:
        """The soft limit (rad) toward which a rate goes."""
        traits = self._drive.traits[name]
        return traits.high if rate > 0 else traits.low

    def stopping_margin(self, name: str, rate: float) -> float:
        """Angle (rad) left before a joint has to begin to stop, so as to be at rest before its soft limit.

        The stop takes v²/2a, and v times the supervision's delay passes before it begins. The command may run ahead
        of the joint, so the one nearer to the limit counts; since the joint was read it may have gone on at the
        greater of the old and the new rate.
        """
        joint, toward = self._latest[name], 1 if rate > 0 else -1
        limit = self.limit_ahead(name, rate)
        ahead = min((limit - joint.angle) * toward, (limit - joint.commanded) * toward)
        speed = max(abs(rate), toward * self._rates[name])
        age = max(0.0, asyncio.get_running_loop().time() - joint.time)
        braking = speed**2 / (2 * self._drive.traits[name].acceleration)
        return ahead - braking - speed * (age + SUPERVISION_SECONDS)

    async def _refresh(self, names: Collection[str]) -> None:
        now = asyncio.get_running_loop().time()
        if any(n not in self._latest or now - self._latest[n].time > FRESH_SECONDS for n in names):
            self.take_reading(await self._drive.read(names))
        for name in names:
            if name not in self._latest:
                raise DeviceFault(f"{name}: only readings from before its last stop arrive", axis=name)

    async def _watch(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._changed.clear()
            moving = [name for name, rate in self._rates.items() if rate != 0]
            if not moving:
                await self._changed.wait()
                continue
            wait = min(self._look_again(name) for name in moving) - loop.time()
            if wait > 0:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait):
                        await self._changed.wait()
                continue
            try:
                self.take_reading(await self._drive.read(moving))
                for name in moving:
                    await self._hold_at_limit(name)
            except MedusaError as error:
                # The line reports its loss itself; the machine's watchdog ends what nobody can watch.
                log.warning("joints in motion not read: %s", error)
                await asyncio.sleep(LOOK_SECONDS[1])

    def _look_again(self, name: str) -> float:
        """Loop time at which a joint that has a rate has to be read: near its limit often."""
        if name not in self._latest:
            return -math.inf
        soonest, latest = LOOK_SECONDS
        rate = self._rates[name]
        # Half the margin at a time, so that a limit is met neither late nor after many readings.
        half = self.stopping_margin(name, rate) / abs(rate) / 2
        return self._latest[name].time + min(latest, max(soonest, half))

    async def _hold_at_limit(self, name: str) -> None:
        rate = self._rates[name]
        if rate == 0 or name not in self._latest or not self._latest[name].homed:
            return
        if self.stopping_margin(name, rate) > 0:
            return
        self._rates[name] = 0.0
        await self._drive.set_rates({name: 0.0})
        limit = math.degrees(self.limit_ahead(name, rate))
        now = asyncio.get_running_loop().time()
        reason = f"held before its soft limit of {limit:.2f}°"
        self._drive.publish(Fault(Cause.SOFT_LIMIT, (name,), reason, now))
