"""One joint's search for its home sensor: coarse, retract, slow approach, each move with its named failure.

Directions are by the joint: +1 is the positive joint angle, whatever the wiring's sign makes of the counts.
"""

import asyncio
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from typing import Any

from medusa.errors import DeviceFault
from medusa.head.faults import Cause, Fault
from medusa.head.stopping import READ_BACK_SECONDS
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import AxisSnapshot, BoardEvent, EventKind, Flags, Inputs, LatchSource, Mode
from medusa.mc3000.board.board import check_position
from medusa.mc3000.fault_reports import FaultReports

Subscribe = Callable[[Callable[[Fault], None]], Callable[[], None]]
"""Listen to a drive's faults; what ends that."""

TRAVEL_MARGIN = 1.2
"""The search goes over this much of the range between the soft limits: past both switches."""
BACK_OFF_DEG = 10.0
"""How far a joint backs off a closed limit switch: hard stops lie closer to it than that."""
CLEARANCE_DEG = 0.5
"""How much further it goes once the switch is open."""
SWITCH_LOOK_SECONDS = 0.025
FOLLOWING_DEG = 1.0
"""Following limit while homing: the speeds are low, and a lost encoder shows the sooner."""
EVENT_SECONDS = 0.7
"""An event that is lost is repeated for this long; then the board itself is asked."""
REST_LOOKS = 100
REST_COUNTS = 1
"""A joint at rest in control may flicker by one count (thesis, servo loop: the DAC's limit cycle)."""
QUIET_LOOKS = 4
"""The zero is set after the count stayed for 0.1 s: a braked joint creeps its last count some T_M late."""


SWITCHES = Inputs.NEGATIVE_LIMIT | Inputs.POSITIVE_LIMIT


class HomingFailure(Enum):
    """Why a joint did not home."""

    NO_SENSOR = "no sensor within travel"
    SENSOR_STUCK_ON = "sensor stuck on"
    BOTH_SWITCHES = "both limit switches at once"
    STILL_ON_SWITCH = "still on the switch after retract"
    LIMIT = "limit switch reached"
    AMPLIFIER_FAULT = "amplifier fault"
    RESTARTED = "board restarted"
    LINE_LOST = "line lost"
    EMERGENCY_STOP = "emergency stop"
    FOLLOWING = "following error"
    WATCHDOG = "watchdog expired"
    NOT_AT_REST = "not at rest"
    INTERRUPTED = "interrupted"


FAILURES = {
    Cause.LIMIT: HomingFailure.LIMIT,
    Cause.DRIVE: HomingFailure.AMPLIFIER_FAULT,
    Cause.RESTARTED: HomingFailure.RESTARTED,
    Cause.LOST: HomingFailure.LINE_LOST,
    Cause.EMERGENCY_STOP: HomingFailure.EMERGENCY_STOP,
    Cause.FOLLOWING: HomingFailure.FOLLOWING,
    Cause.WATCHDOG: HomingFailure.WATCHDOG,
}


class HomingError(DeviceFault):
    """A joint did not home; `failure` says why. The joint is left disabled and not homed."""

    def __init__(self, axis: str, failure: HomingFailure, detail: str = "") -> None:
        self.failure = failure
        super().__init__(
            f"{axis}: homing failed: {failure.value}" + (f" ({detail})" if detail else ""), axis=axis
        )


class Ending(Enum):
    """How one move of the search ended."""

    CAUGHT = "edge"
    LIMIT = "limit switch"
    DONE = "profile done"


@dataclass(frozen=True)
class Leg:
    """How a move of the search ended, and where (counts): the latched edge, or where the joint was."""

    ending: Ending
    position: int


class HomingSearch:
    """Moves one joint to its sensor's edge; `fault` ends it as soon as anything stops the head."""

    def __init__(self, axis: Axis, reports: FaultReports, subscribe: Subscribe) -> None:
        self._axis = axis
        self._reports = reports
        self._subscribe = subscribe
        self._fault: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.faults: list[Fault] = []

    @contextmanager
    def listening(self) -> Iterator[None]:
        """Within the context this joint's limit switches are expected, and any fault ends the search."""
        with self._reports.limit_expected(self._axis.name):
            end = self._subscribe(self._take_fault)
            try:
                yield
            finally:
                end()

    async def find_edge(self) -> tuple[int, int]:
        """(coarse, latched) count of the edge, the latter taken slowly toward the positive joint angle."""
        await self._leave_limits()
        coarse = await self._coarse()
        await self._retract(coarse)
        return coarse, await self._approach(coarse)

    def _take_fault(self, fault: Fault) -> None:
        if fault.stops_all:
            self.faults.append(fault)
            if not self._fault.done():
                self._fault.set_result(None)

    def _fail(self, failure: HomingFailure, detail: str = "") -> HomingError:
        return HomingError(self._axis.name, failure, detail)

    def failure(self) -> HomingError | None:
        """The named failure behind what stopped the head meanwhile; of several, this joint's own."""
        for fault in self.faults:
            if self._axis.name in fault.joints:
                return self._fail(FAILURES.get(fault.cause, HomingFailure.INTERRUPTED), fault.reason)
        for fault in self.faults:
            return self._fail(HomingFailure.INTERRUPTED, f"{', '.join(fault.joints)}: {fault.reason}")
        return None

    def raise_fault(self) -> None:
        """Raise HomingError if something stopped the head meanwhile."""
        failure = self.failure()
        if failure is not None:
            raise failure

    async def _inputs(self) -> Inputs:
        inputs = await self._axis.board.inputs(self._axis.channel)
        if inputs & Inputs.NEGATIVE_LIMIT and inputs & Inputs.POSITIVE_LIMIT:
            raise self._fail(HomingFailure.BOTH_SWITCHES, f"inputs {inputs:02X}H")
        if inputs & Inputs.AMPLIFIER_FAULT or inputs & Inputs.FAULT_LATCHED:
            raise self._fail(HomingFailure.AMPLIFIER_FAULT, f"inputs {inputs:02X}H")
        return inputs

    async def _leave_limits(self) -> None:
        inputs = await self._inputs()
        if inputs & (Inputs.LIMIT_LATCHED | SWITCHES):
            await self._back_off()
        else:
            await self._enter_position()

    async def _enter_position(self) -> None:
        config = self._axis.config
        await self._axis.set_mode(Mode.POSITION)
        limit = min(config.following_limit_counts, round(FOLLOWING_DEG * config.counts_per_degree))
        await self._axis.board.following(self._axis.channel, limit)

    async def _back_off(self) -> None:
        """Leave a limit switch as the board's page has it: idle, limits off, CLEAR, MODE, move, limits on.

        Slowly, and in one motion: a closed switch's directional inhibit lets the amplifier drive away from
        the switch but not brake.
        """
        axis, board, channel, config = self._axis, self._axis.board, self._axis.channel, self._axis.config
        await axis.set_mode(Mode.IDLE, after_pending=True)
        await self._rest()
        await board.limit_enable(channel, False)
        await board.clear(channel)
        await self._enter_position()
        closed = await self._inputs() & SWITCHES
        if closed:
            away = 1 if closed & Inputs.NEGATIVE_LIMIT else -1
            here = await board.position(channel)
            profile = axis.profile(max_speed=config.approach_speed)
            distance = away * config.counts_per_degree
            seconds = await axis.start(here + round(distance * BACK_OFF_DEG), profile)
            loop = asyncio.get_running_loop()
            end = loop.time() + seconds - SWITCH_LOOK_SECONDS
            while loop.time() < end:
                self.raise_fault()
                closed = await self._inputs() & SWITCHES
                if not closed:
                    break
                await asyncio.sleep(SWITCH_LOOK_SECONDS)
            if closed:
                raise self._fail(
                    HomingFailure.STILL_ON_SWITCH, f"limit switch closed after {BACK_OFF_DEG:g}°"
                )
            await axis.stop(after_pending=True)
            here = await self._rest()
            await self._go(here + round(distance * CLEARANCE_DEG), config.approach_speed)
        await board.limit_enable(channel, True)

    async def _coarse(self) -> int:
        if await self._inputs() & Inputs.HOME:
            leg = await self._search(-1, LatchSource.HOME_FALLING)
            if leg.ending is not Ending.CAUGHT:
                raise self._fail(HomingFailure.SENSOR_STUCK_ON, f"until the {leg.ending.value}")
            return leg.position
        leg = await self._search(1, LatchSource.HOME_RISING)
        if leg.ending is Ending.CAUGHT:
            return leg.position
        if leg.ending is Ending.LIMIT:
            await self._back_off()
        leg = await self._search(-1, LatchSource.HOME_RISING)
        if leg.ending is not Ending.CAUGHT:
            raise self._fail(HomingFailure.NO_SENSOR, f"up to the {leg.ending.value}")
        # Entered from the far side: the edge that counts is where the sensor goes off again.
        leg = await self._search(-1, LatchSource.HOME_FALLING)
        if leg.ending is not Ending.CAUGHT:
            raise self._fail(HomingFailure.SENSOR_STUCK_ON, f"until the {leg.ending.value}")
        return leg.position

    async def _search(self, direction: int, source: LatchSource) -> Leg:
        config = self._axis.config
        travel = TRAVEL_MARGIN * (config.soft_max_deg - config.soft_min_deg) * config.counts_per_degree
        here = await self._axis.board.position(self._axis.channel)
        return await self._go(here + round(direction * config.sign * travel), config.search_speed, source)

    async def _retract(self, edge: int) -> None:
        config = self._axis.config
        away = round(config.sign * config.retract_deg * config.counts_per_degree)
        leg = await self._go(edge - away, config.search_speed)
        if leg.ending is Ending.LIMIT:
            raise self._fail(HomingFailure.LIMIT, f"while retracting {config.retract_deg:g}°")
        if await self._inputs() & Inputs.HOME:
            raise self._fail(HomingFailure.STILL_ON_SWITCH, f"{config.retract_deg:g}° before its edge")

    async def _approach(self, edge: int) -> int:
        config = self._axis.config
        beyond = round(config.sign * config.retract_deg * config.counts_per_degree)
        leg = await self._go(edge + beyond, config.approach_speed, LatchSource.HOME_RISING)
        if leg.ending is Ending.LIMIT:
            raise self._fail(HomingFailure.LIMIT, "on the slow approach")
        if leg.ending is Ending.DONE:
            raise self._fail(HomingFailure.NO_SENSOR, f"{config.retract_deg:g}° around where it was found")
        return leg.position

    async def _go(self, final: int, speed: float, source: LatchSource = LatchSource.DISARMED) -> Leg:
        """Move to `final` (counts) at `speed` (rad/s) until the edge, a limit switch or the end; then rest."""
        axis = self._axis
        check_position(final)
        profile = axis.profile(max_speed=speed)
        ended: asyncio.Future[Leg] = asyncio.get_running_loop().create_future()
        leave = axis.subscribe(_leg_listener(axis, ended))
        try:
            if source is not LatchSource.DISARMED:
                await axis.board.latch(axis.channel, source)
            seconds = await axis.start(final, profile)
            either: set[asyncio.Future[Any]] = {ended, self._fault}
            await asyncio.wait(either, timeout=seconds + EVENT_SECONDS, return_when=asyncio.FIRST_COMPLETED)
        finally:
            leave()
        self.raise_fault()
        leg = ended.result() if ended.done() else await self._ask(source)
        if leg.ending is not Ending.LIMIT:
            await axis.stop(after_pending=True)
        await self._rest()
        return leg

    async def _ask(self, source: LatchSource) -> Leg:
        """How the move ended, from the board itself: the event was lost."""
        axis = self._axis
        if source is not LatchSource.DISARMED:
            latched = await axis.board.latched(axis.channel)
            if latched.caught:
                return Leg(Ending.CAUGHT, latched.position)
        position = await axis.board.position(axis.channel)
        limited = await self._inputs() & Inputs.LIMIT_LATCHED
        return Leg(Ending.LIMIT if limited else Ending.DONE, position)

    async def rest_idle(self) -> int:
        """Go idle, wait until the count has stayed for long, and return it."""
        await self._axis.set_mode(Mode.IDLE, after_pending=True)
        return await self._rest(still=0, looks=QUIET_LOOKS)

    async def _rest(self, still: int = REST_COUNTS, looks: int = 1) -> int:
        axis = self._axis
        last: int | None = None
        quiet = 0
        for _ in range(REST_LOOKS):
            self.raise_fault()
            snapshot, time = await axis.board.timed_snapshot()
            reading = snapshot.axes[axis.channel]
            axis.take_snapshot(reading, time)
            at_rest = last is not None and abs(reading.actual - last) <= still and _is_stopped(reading)
            quiet = quiet + 1 if at_rest else 0
            if quiet >= looks:
                return reading.actual
            last = reading.actual
            await asyncio.sleep(READ_BACK_SECONDS)
        raise self._fail(HomingFailure.NOT_AT_REST, f"{REST_LOOKS * READ_BACK_SECONDS:.1f} s after the stop")


def _is_stopped(reading: AxisSnapshot) -> bool:
    """True when nothing commands motion: idle, or position mode without a profile."""
    if reading.mode is Mode.IDLE:
        return True
    return reading.mode is Mode.POSITION and not reading.flags & Flags.PROFILE


def _leg_listener(axis: Axis, ended: "asyncio.Future[Leg]") -> Callable[[BoardEvent], None]:
    endings = {
        EventKind.LATCH_CAUGHT: Ending.CAUGHT,
        EventKind.LIMIT_REACHED: Ending.LIMIT,
        EventKind.PROFILE_DONE: Ending.DONE,
    }

    began = asyncio.get_running_loop().time()

    def received(event: BoardEvent) -> None:
        ending = endings.get(event.kind)
        time = axis.board.clock.to_loop(event.time_us)
        # An event of an earlier leg that had to be repeated ends no later one.
        stale = time is not None and time < began
        if ending is not None and not stale and not ended.done():
            ended.set_result(Leg(ending, event.position))

    return received
