"""Moving several joints together: armed, begun at once, followed until they are at rest."""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Collection, Coroutine, Mapping
from dataclasses import dataclass, field
from typing import Any

from medusa.completion import run_to_completion
from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.drive import Drive, MoveEnds, MovePlan, Reading, Speeds
from medusa.head.faults import Fault, JointFault
from medusa.head.soft_limits import check_acceleration, check_angle, check_speed
from medusa.head.stopping import REST_STEPS, is_stopped

log = logging.getLogger(__name__)

SETTLE_SECONDS = 0.5
SETTLE_LOOK_SECONDS = 0.02
RAMP_LOOK_SECONDS = 0.01
RAMP_MARGIN_SECONDS = 0.5
"""On top of a rate's ramp: the link's repeats."""


@dataclass(frozen=True)
class MoveReport:
    """How a move went. Angles rad, times s on the loop's clock, errors rad (where it should end − where it is)."""

    plan: MovePlan
    ends: MoveEnds
    errors: dict[str, float]
    settled: dict[str, bool]
    reading: Reading = field(repr=False)

    @property
    def all_settled(self) -> bool:
        """Every joint is at rest within its traits' `settle` of its final angle."""
        return all(self.settled.values())

    @property
    def start_skew(self) -> float:
        """Between the first and the last start, s; 0 for joints of one device."""
        started = [time for time in self.ends.started.values() if not math.isnan(time)]
        return max(started) - min(started) if started else 0.0

    @property
    def end_skew(self) -> float:
        """Between the first and the last end of those that were to end together, s; NaN when unknown."""
        ended = [t for n, t in self.ends.ended.items() if n not in self.plan.early and not math.isnan(t)]
        return max(ended) - min(ended) if ended else math.nan


class MoveStopped(MedusaError):
    """Somebody stopped the head while a move was running; it is at rest, or the stop's own error names why not."""

    origin = "caller"


class MoveRefused(MedusaError):
    """A move cannot be made; nothing has begun, so nothing has to be stopped."""

    def __init__(self, error: BaseException) -> None:
        self.error = error
        super().__init__(str(error))


class Moves:
    """Runs moves of a drive's joints; `stop` is the group's confirmed stop."""

    def __init__(
        self,
        drive: Drive,
        stop: Callable[[], Coroutine[Any, Any, None]],
        stopped_by_fault: Callable[[], Awaitable[str]],
    ) -> None:
        self._drive = drive
        self._stop = stop
        self._stopped_by_fault = stopped_by_fault
        self._stops = 0
        self._running: dict[asyncio.Future[MedusaError], frozenset[str]] = {}

    def is_running(self, names: Collection[str]) -> bool:
        """True while a move of any of these joints is under way."""
        return any(not moved.isdisjoint(names) for moved in self._running.values())

    def forget_armed(self) -> None:
        """Latches are being released, which disarms: moves about to begin do not; running ones run on."""
        self._stops += 1

    def interrupt(self, reason: str) -> None:
        """A stop is on its way: running moves end with MoveStopped, moves about to begin do not."""
        self._stops += 1
        for failure in self._running:
            if not failure.done():
                failure.set_result(MoveStopped(reason))

    async def run(
        self, targets: Mapping[str, float], speeds: Mapping[str, Speeds], *, together: bool = False
    ) -> MoveReport:
        """Move the named joints to their angles (rad) and wait until they are at rest.

        `together`: their profiles are stretched to end at once. Raises CommandError before anything moves for a
        target, speed or state that does not allow it, JointFault with the reason when something stops the head on
        the way (it is at rest then), and MoveStopped when somebody else stops it.
        """
        stops = self._stops
        for name in targets:
            if any(name in names for names in self._running.values()):
                raise CommandError(f"{name}: is moving already; stop it or wait for its move")
        failure: asyncio.Future[MedusaError] = asyncio.get_running_loop().create_future()

        def take(fault: Fault) -> None:
            if fault.stops_all and not failure.done():
                failure.set_result(JointFault(fault))

        end = self._drive.subscribe(take)
        self._running[failure] = frozenset(targets)
        try:
            plan = await self._prepare(targets, speeds, together)
            if stops != self._stops:
                raise MoveStopped("the head was stopped before the move began")
            return await self._follow(plan, failure)
        except MoveRefused as refused:
            raise refused.error from None
        except MedusaError as error:
            await self._stopped(error, failure, stops)
            raise
        except BaseException:
            # Cancelled half-way: whatever began comes to rest before the caller goes on.
            await run_to_completion(self._stop())
            raise
        finally:
            del self._running[failure]
            end()

    async def _stopped(self, error: MedusaError, failure: "asyncio.Future[MedusaError]", stops: int) -> None:
        """See to it that the head is at rest before the error leaves, and let the deeper cause speak."""
        if failure.done():
            cause: MedusaError = failure.result()
            if isinstance(cause, JointFault):
                cause = JointFault(cause.report, await self._stopped_by_fault())
            raise cause from (None if isinstance(error, JointFault | MoveStopped) else error)
        if stops != self._stops:
            return
        try:
            await self._stop()
        except MedusaError as unconfirmed:
            raise DeviceFault(f"{error}; {unconfirmed}", axis=getattr(unconfirmed, "axis", None)) from error

    async def _prepare(
        self, targets: Mapping[str, float], speeds: Mapping[str, Speeds], together: bool
    ) -> MovePlan:
        reading = await self._drive.read()
        try:
            for name, angle in targets.items():
                self._check(name, angle, speeds.get(name, Speeds()), reading)
        except CommandError as error:
            raise MoveRefused(error) from None
        if not self._drive.can.retargets:
            reading = await self._end_rates(targets, reading)
        try:
            plan = self._drive.plan(reading, targets, speeds, together=together)
            await self._drive.arm(plan)
        except CommandError as error:
            raise MoveRefused(error) from error
        if plan.early:
            log.warning("%s: too near to be stretched, ends early", ", ".join(plan.early))
        return plan

    def _check(self, name: str, angle: float, speeds: Speeds, reading: Reading) -> None:
        traits, joint = self._drive.traits[name], reading.joints[name]
        if not joint.enabled:
            raise CommandError(f"{name}: is idle; enable it first")
        if not joint.homed:
            raise CommandError(f"{name}: is not homed, so {math.degrees(angle):.2f}° means nothing")
        check_angle(name, angle, traits)
        if speeds.max_speed is not None:
            check_speed(name, speeds.max_speed, traits)
        if speeds.acceleration is not None:
            check_acceleration(name, speeds.acceleration, traits)

    async def _end_rates(self, names: Collection[str], reading: Reading) -> Reading:
        """Bring joints that have a rate to rest by their ramp; the reading after it."""
        loop = asyncio.get_running_loop()
        moving = [name for name in names if not is_stopped(reading.joints[name])]
        if not moving:
            return reading
        asked = loop.time()
        deadline = asked + max(self._drive.traits[n].ramp_seconds for n in moving) + RAMP_MARGIN_SECONDS
        await self._drive.stop(moving)
        while True:
            reading = await self._drive.read()
            joints = [reading.joints[name] for name in moving]
            if all(is_stopped(joint) and joint.time > asked for joint in joints):
                return reading
            if loop.time() > deadline:
                names = ", ".join(name for name in moving if not is_stopped(reading.joints[name]))
                raise DeviceFault(f"{names}: a rate did not end by its ramp", axis=names)
            await asyncio.sleep(RAMP_LOOK_SECONDS)

    async def _follow(self, plan: MovePlan, failure: "asyncio.Future[MedusaError]") -> MoveReport:
        running = asyncio.ensure_future(self._drive.run(plan))
        either: set[asyncio.Future[Any]] = {running, failure}
        try:
            await asyncio.wait(either, return_when=asyncio.FIRST_COMPLETED)
            if failure.done():
                raise failure.result()
            ends = running.result()
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
        reading, settled = await self._settle(plan, failure)
        report = MoveReport(
            plan=plan,
            ends=ends,
            errors={name: final - reading.joints[name].angle for name, final in plan.finals.items()},
            settled=settled,
            reading=reading,
        )
        if ends.repeated:
            log.warning(
                "START had to be repeated on %s; the joints began %.1f ms apart",
                ", ".join(ends.repeated),
                report.start_skew * 1000,
            )
        return report

    async def _settle(
        self, plan: MovePlan, failure: "asyncio.Future[MedusaError]"
    ) -> tuple[Reading, dict[str, bool]]:
        loop = asyncio.get_running_loop()
        deadline = loop.time() + SETTLE_SECONDS
        last: dict[str, float] = {}
        while True:
            reading = await self._drive.read()
            if failure.done():
                raise failure.result()
            settled = {}
            for name, final in plan.finals.items():
                traits, angle = self._drive.traits[name], reading.joints[name].angle
                resting = name in last and abs(angle - last[name]) <= REST_STEPS * traits.resolution
                settled[name] = resting and abs(final - angle) <= traits.settle + 0.1 * traits.resolution
                last[name] = angle
            if all(settled.values()):
                return reading, settled
            if loop.time() > deadline:
                log.warning("not settled: %s", ", ".join(name for name, ok in settled.items() if not ok))
                return reading, settled
            await asyncio.sleep(SETTLE_LOOK_SECONDS)
