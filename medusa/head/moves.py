"""Moving several joints together: armed, started at once on every board, followed until they rest."""

import asyncio
import logging
import math
from collections.abc import Awaitable, Callable, Collection, Coroutine, Mapping
from dataclasses import dataclass, field
from typing import Any

from medusa.completion import complete
from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.faults import Fault, FaultHub, HeadFault
from medusa.head.snapshots import HeadSnapshot, SnapshotReader
from medusa.mc3000.axis import ArmedMove, Axis
from medusa.mc3000.board import Board, BoardEvent, Flags, Operation

log = logging.getLogger(__name__)

EVENT_MARGIN_SECONDS = 0.7
"""How much later than planned "profile done" may come before the boards are asked: six sendings of an event."""
SETTLE_SECONDS = 0.5
SETTLE_LOOK_SECONDS = 0.02
RESTING_COUNTS = 1


@dataclass(frozen=True)
class Speeds:
    """Acceleration (rad/s²) and greatest speed (rad/s) of one joint's move; the configuration's when None."""

    acceleration: float | None = None
    max_speed: float | None = None


@dataclass(frozen=True)
class MoveReport:
    """How a move went. Angles rad, times s on the loop's clock, errors in counts (command − actual)."""

    targets: dict[str, float]
    planned: dict[str, float]
    started: dict[int, float]
    ended: dict[str, float]
    repeated: tuple[int, ...]
    errors_counts: dict[str, int]
    settled: dict[str, bool]
    snapshot: HeadSnapshot = field(repr=False)

    @property
    def skew(self) -> float:
        """Between the first and the last board's start, s, from the boards' own stamps; 0 with one board."""
        return max(self.started.values()) - min(self.started.values()) if self.started else 0.0


class MoveStopped(MedusaError):
    """Somebody stopped the head while a move was running; it stands, or the stop's own error says why not."""

    fault = "caller"


class MoveRefused(MedusaError):
    """A joint could not be armed; nothing has begun, so nothing has to be stopped."""

    def __init__(self, error: BaseException) -> None:
        self.error = error
        super().__init__(str(error))


class Moves:
    """Runs moves of the head's joints in position mode."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        boards: Mapping[int, Board],
        reader: SnapshotReader,
        faults: FaultHub,
        stop: Callable[[], Coroutine[Any, Any, None]],
        stopped_by_fault: Callable[[], Awaitable[str]],
    ) -> None:
        self._axes = axes
        self._boards = boards
        self._reader = reader
        self._faults = faults
        self._stop = stop
        self._stopped_by_fault = stopped_by_fault
        self.stops = 0
        self._running: dict[asyncio.Future[MedusaError], frozenset[str]] = {}

    def is_running(self, names: Collection[str]) -> bool:
        """True while a move of any of these joints is under way."""
        return any(not moved.isdisjoint(names) for moved in self._running.values())

    def forget_armed(self) -> None:
        """CLEAR is on its way, which disarms: moves about to begin do not; running ones run on."""
        self.stops += 1

    def interrupt(self, reason: str) -> None:
        """A stop is on its way: running moves end with MoveStopped, moves about to begin do not."""
        self.stops += 1
        for trouble in self._running:
            if not trouble.done():
                trouble.set_result(MoveStopped(reason))

    async def run(
        self, targets: Mapping[str, float], speeds: Mapping[str, Speeds] | None = None
    ) -> MoveReport:
        """Move the named joints to their angles (rad) and wait until they rest.

        Raises CommandError before anything moves for a target, speed or mode that does not allow it,
        HeadFault with the reason when something stops the head on the way (it stands then), and MoveStopped
        when somebody else stops it.
        """
        stops = self.stops
        speeds = speeds or {}
        for name, angle in targets.items():
            self._check(name, angle, speeds.get(name, Speeds()))
            if any(name in names for names in self._running.values()):
                raise CommandError(f"{name}: is moving already; stop it or wait for its move")
        trouble: asyncio.Future[MedusaError] = asyncio.get_running_loop().create_future()

        def note(fault: Fault) -> None:
            if fault.stops_head and not trouble.done():
                trouble.set_result(HeadFault(fault))

        end = self._faults.subscribe(note)
        self._running[trouble] = frozenset(targets)
        try:
            armed = await self._arm(targets, speeds, await self._reader.read())
            if stops != self.stops:
                raise MoveStopped("the head was stopped before the move began")
            return await self._follow(targets, armed, trouble)
        except MoveRefused as refused:
            raise refused.error from None
        except MedusaError as error:
            await self._stopped(error, trouble, stops)
            raise
        except BaseException:
            # Cancelled half-way: whatever began comes to rest before anybody hears of it.
            await complete(self._stop())
            raise
        finally:
            del self._running[trouble]
            end()

    async def _stopped(self, error: MedusaError, trouble: "asyncio.Future[MedusaError]", stops: int) -> None:
        """Bring everything to rest after an error; raises what tells most about its cause."""
        if trouble.done():
            cause = trouble.result()
            if isinstance(cause, HeadFault):
                cause = HeadFault(cause.cause, await self._stopped_by_fault())
            raise cause from (None if isinstance(error, HeadFault | MoveStopped) else error)
        if stops != self.stops:
            return
        try:
            await self._stop()
        except MedusaError as unconfirmed:
            raise DeviceFault(f"{error}; {unconfirmed}", axis=getattr(unconfirmed, "axis", None)) from error

    def _check(self, name: str, angle: float, speeds: Speeds) -> None:
        if name not in self._axes:
            raise CommandError(f"there is no joint {name!r}; the head has {', '.join(self._axes)}")
        self._axes[name].check_move(angle, speeds.acceleration, speeds.max_speed)

    async def _arm(
        self, targets: Mapping[str, float], speeds: Mapping[str, Speeds], before: HeadSnapshot
    ) -> dict[str, ArmedMove]:
        async def arm(name: str, angle: float) -> ArmedMove:
            wanted = speeds.get(name, Speeds())
            return await self._axes[name].arm(
                angle,
                acceleration=wanted.acceleration,
                max_speed=wanted.max_speed,
                command_counts=before.joints[name].command_counts,
            )

        arming = [arm(name, angle) for name, angle in targets.items()]
        ended = await asyncio.gather(*arming, return_exceptions=True)
        failures = [end for end in ended if isinstance(end, BaseException)]
        for failure in failures:
            if not isinstance(failure, CommandError):
                raise failure
        if failures:
            # Nothing has begun: those that are armed forget it, and what else moves goes on.
            await asyncio.gather(*(self._axes[name].stop(orderly=True) for name in targets))
            raise MoveRefused(failures[0])
        return {move.axis: move for move in ended if isinstance(move, ArmedMove)}

    async def _follow(
        self,
        targets: Mapping[str, float],
        armed: Mapping[str, ArmedMove],
        trouble: "asyncio.Future[MedusaError]",
    ) -> MoveReport:
        done = Arrivals({name: self._axes[name] for name in armed})
        try:
            repeated = await self._start(armed)
            await self._race(done, armed, trouble)
        finally:
            done.close()
        snapshot, settled = await self._settle(armed, trouble)
        ended = {name: time for name, time in done.times.items() if not math.isnan(time)}
        started = self._starts(armed, ended)
        report = MoveReport(
            targets=dict(targets),
            planned={name: move.seconds for name, move in armed.items()},
            started=started,
            ended=ended,
            repeated=repeated,
            errors_counts={
                name: move.final - snapshot.joints[name].position_counts for name, move in armed.items()
            },
            settled=settled,
            snapshot=snapshot,
        )
        if repeated:
            log.warning(
                "START had to be repeated on board %s; the boards began %.1f ms apart",
                ", ".join(f"{address:02X}H" for address in repeated),
                report.skew * 1000,
            )
        return report

    async def _start(self, armed: Mapping[str, ArmedMove]) -> tuple[int, ...]:
        """Both STARTs leave in one turn of the loop; the boards whose START had to be repeated."""
        masks: dict[int, int] = {}
        for name in armed:
            axis = self._axes[name]
            masks[axis.board.address] = masks.get(axis.board.address, 0) | 1 << axis.channel
        repeats = {address: self._boards[address].repeats for address in masks}
        await asyncio.gather(*(self._boards[address].start(mask) for address, mask in masks.items()))
        return tuple(address for address in masks if self._boards[address].repeats != repeats[address])

    async def _race(
        self, done: "Arrivals", armed: Mapping[str, ArmedMove], trouble: "asyncio.Future[MedusaError]"
    ) -> None:
        longest = max((move.seconds for move in armed.values()), default=0.0)
        either: set[asyncio.Future[Any]] = {done.all, trouble}
        await asyncio.wait(
            either, timeout=longest + EVENT_MARGIN_SECONDS, return_when=asyncio.FIRST_COMPLETED
        )
        if trouble.done():
            raise trouble.result()
        if done.all.done():
            return
        snapshot = await self._reader.read()
        late = [
            name
            for name, move in armed.items()
            if snapshot.joints[name].flags & Flags.PROFILE
            or snapshot.joints[name].command_counts != move.final
        ]
        if late:
            raise DeviceFault(
                f"{', '.join(late)}: profile not done {longest:.2f} s after START", axis=late[0]
            )

    async def _settle(
        self, armed: Mapping[str, ArmedMove], trouble: "asyncio.Future[MedusaError]"
    ) -> tuple[HeadSnapshot, dict[str, bool]]:
        loop = asyncio.get_running_loop()
        deadline = loop.time() + SETTLE_SECONDS
        last: dict[str, int] = {}
        while True:
            snapshot = await self._reader.read()
            if trouble.done():
                raise trouble.result()
            settled = {}
            for name, move in armed.items():
                position = snapshot.joints[name].position_counts
                resting = name in last and abs(position - last[name]) <= RESTING_COUNTS
                settled[name] = (
                    resting and abs(move.final - position) <= self._axes[name].config.settle_counts
                )
                last[name] = position
            if all(settled.values()):
                return snapshot, settled
            if loop.time() > deadline:
                log.warning("not settled: %s", ", ".join(name for name, ok in settled.items() if not ok))
                return snapshot, settled
            await asyncio.sleep(SETTLE_LOOK_SECONDS)

    def _starts(self, armed: Mapping[str, ArmedMove], ended: Mapping[str, float]) -> dict[int, float]:
        """When each board began: the stamp of a profile's end less the length that the page gives it."""
        starts: dict[int, float] = {}
        for name, time in ended.items():
            address = self._axes[name].board.address
            starts.setdefault(address, time - armed[name].seconds)
        return starts


class Arrivals:
    """Waits for "profile done" of several axes; `times` holds the board's stamps on the loop's clock, s."""

    def __init__(self, axes: Mapping[str, Axis]) -> None:
        loop = asyncio.get_running_loop()
        self.all: asyncio.Future[None] = loop.create_future()
        self.times: dict[str, float] = {}
        self._axes = axes
        self._since = loop.time()
        self._ends = [axis.subscribe(self._listener(name)) for name, axis in axes.items()]
        if not axes:
            self.all.set_result(None)

    def _listener(self, name: str) -> Callable[[BoardEvent], None]:
        def heard(event: BoardEvent) -> None:
            if event.operation is not Operation.PROFILE_DONE:
                return
            time = self._axes[name].board.clock.to_loop(event.time_us)
            if time is not None and time < self._since:
                return
            self.times[name] = math.nan if time is None else time
            if len(self.times) == len(self._axes) and not self.all.done():
                self.all.set_result(None)

        return heard

    def close(self) -> None:
        """Listen no longer."""
        for end in self._ends:
            end()
