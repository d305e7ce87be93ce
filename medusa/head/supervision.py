"""What watches the head while it can move: watchdogs fed, soft limits kept, stalls seen.

Three small tasks, none of which polls faster than it has to: boards are pinged only when nothing else was
heard from them, and joints are looked at only while a velocity is commanded.
"""

import asyncio
import contextlib
import logging
import math
from collections.abc import Mapping

from medusa.errors import MedusaError
from medusa.head.faults import Fault, FaultHub, FaultKind
from medusa.head.snapshots import HeadSnapshot, SnapshotReader
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, Inputs, Mode
from medusa.mc3000.config import HeadConfig
from medusa.mc3000.joint import VELOCITY_MODES
from medusa.servo_amp import Amplifier

log = logging.getLogger(__name__)

FEEDS_PER_TIMEOUT = 3
"""A watchdog is fed three times a period, so that one lost frame and its repeat do not trip it."""
FEED_SENDINGS = 3
"""Sendings that fit between two feeds: six before the watchdog expires."""
STALL_SECONDS = 0.1
STALL_RATIO = 0.5
EARLY_SECONDS = 1e-6
STALL_LOOK_SECONDS = 0.02
LOOK_SECONDS = (0.01, 0.25)


class Lag:
    """What a joint should have gone and went since a moment, counts."""

    def __init__(self, time: float, position: int) -> None:
        self.since = time
        self._start = position
        self._time = time
        self._wanted = 0.0

    def take(self, time: float, position: int, velocity_counts_s: float) -> tuple[int, float]:
        """(went, wanted) after one more look, with the velocity commanded since the last one."""
        self._wanted += velocity_counts_s * (time - self._time)
        self._time = time
        return position - self._start, self._wanted


class Supervision:
    """Runs from the moment the head is enabled until it is disabled."""

    def __init__(
        self,
        axes: Mapping[str, Axis],
        boards: Mapping[int, Board],
        amplifiers: Mapping[str, Amplifier],
        reader: SnapshotReader,
        faults: FaultHub,
        config: HeadConfig,
    ) -> None:
        self._axes = axes
        self._boards = boards
        self._amplifiers = amplifiers
        self._reader = reader
        self._faults = faults
        self._safety = config.safety
        self._velocity_changed = asyncio.Event()
        self._tasks: list[asyncio.Task[None]] = []
        self._lags: dict[str, Lag] = {}
        for axis in axes.values():
            axis.velocity_changed = self._velocity_changed.set

    @property
    def running(self) -> bool:
        """True while the watchdogs are fed."""
        return bool(self._tasks)

    def start(self) -> None:
        """Begin to feed and to watch; the watchdogs have been switched on."""
        if self._tasks:
            return
        loop = asyncio.get_running_loop()
        self._tasks = [
            loop.create_task(self._feed_boards(), name="feed boards"),
            loop.create_task(self._watch_velocities(), name="watch velocities"),
        ]
        if self._safety.amplifier_watchdog_ms > 0:
            self._tasks.append(loop.create_task(self._feed_amplifiers(), name="feed amplifiers"))

    async def end(self) -> None:
        """Stop feeding; the watchdogs have been switched off, or are to expire."""
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    async def _feed_boards(self) -> None:
        loop = asyncio.get_running_loop()
        period = self._safety.board_watchdog_ms / 1000 / FEEDS_PER_TIMEOUT

        async def feed(board: Board) -> None:
            # Every answered request feeds; one is made up only when nothing else was heard. It is an
            # addressed one, whose reply shows that the host still hears whom it keeps in motion.
            heard = True
            while True:
                wait = board.heard + period - loop.time()
                if not board.may_move:
                    wait = period
                if wait > EARLY_SECONDS:
                    await asyncio.sleep(wait)
                    continue
                try:
                    await board.feed(period / FEED_SENDINGS)
                    heard = True
                except MedusaError as error:
                    if heard:
                        log.warning("board %02XH not fed: %s", board.address, error)
                    heard = False
                    await asyncio.sleep(period)

        await asyncio.gather(*(feed(board) for board in self._boards.values()))

    async def _feed_amplifiers(self) -> None:
        period = self._safety.amplifier_watchdog_ms / 1000 / FEEDS_PER_TIMEOUT
        reported: set[str] = set()
        while True:
            await asyncio.sleep(period)
            for name, amplifier in self._amplifiers.items():
                try:
                    faults = (await amplifier.status()).faults
                    kind, reason = FaultKind.AMPLIFIER, f"amplifier fault: {', '.join(faults)}"
                except MedusaError as error:
                    faults = ("not heard",)
                    kind, reason = FaultKind.LOST, f"amplifier not heard: {error}"
                if not faults:
                    reported.discard(name)
                elif name not in reported:
                    reported.add(name)
                    if kind is FaultKind.LOST or not await self._told_by_board(name):
                        self._report(name, kind, reason)

    async def _told_by_board(self, name: str) -> bool:
        axis = self._axes[name]
        try:
            return bool(await axis.board.inputs(axis.channel) & Inputs.FAULT_LATCHED)
        except MedusaError:
            return False

    def _report(self, name: str, kind: FaultKind, reason: str) -> None:
        now = asyncio.get_running_loop().time()
        self._faults.publish(Fault(kind, (name,), reason, now))

    async def _watch_velocities(self) -> None:
        loop = asyncio.get_running_loop()
        while True:
            self._velocity_changed.clear()
            moving = [
                axis
                for axis in self._axes.values()
                if axis.mode in VELOCITY_MODES and axis.command_velocity != 0
            ]
            if not moving:
                self._lags.clear()
                await self._velocity_changed.wait()
                continue
            wait = min(self._look_again(axis) for axis in moving) - loop.time()
            if wait > 0:
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout(wait):
                        await self._velocity_changed.wait()
                continue
            try:
                snapshot = await self._reader.read()
                for axis in moving:
                    await self._watch(axis, snapshot)
            except MedusaError as error:
                # The link reports the loss itself; the board's watchdog ends what nobody can watch.
                log.warning("joints in motion not seen: %s", error)
                await asyncio.sleep(LOOK_SECONDS[1])

    def _look_again(self, axis: Axis) -> float:
        """Loop time at which a joint in a velocity mode has to be looked at: near its limit often."""
        seen = axis.seen
        if seen is None:
            return -math.inf
        soonest, latest = LOOK_SECONDS
        if axis.mode is Mode.PROPORTIONAL_VELOCITY:
            latest = STALL_LOOK_SECONDS
        room = axis.room(axis.command_velocity, seen)
        # Half the room at a time, so that a limit is met neither late nor after many looks.
        return seen.time + min(latest, max(soonest, room / abs(axis.command_velocity) / 2))

    async def _watch(self, axis: Axis, snapshot: HeadSnapshot) -> None:
        """Hold a joint that comes near its soft limit, idle one that stalls."""
        velocity = axis.command_velocity
        if velocity == 0 or axis.mode not in VELOCITY_MODES or axis.seen is None:
            return
        if axis.homed and axis.room(velocity, axis.seen) <= 0:
            await axis.hold()
            limit = math.degrees(axis.limit_ahead(velocity))
            self._report(axis.name, FaultKind.SOFT_LIMIT, f"held before its soft limit of {limit:.2f}°")
        elif axis.mode is Mode.PROPORTIONAL_VELOCITY:
            joint = snapshot.joints[axis.name]
            await self._watch_stall(axis, joint.time, joint.position_counts)

    async def _watch_stall(self, axis: Axis, time: float, position: int) -> None:
        """In mode 2 the board supervises no following error: go idle when the counts lag for 100 ms."""
        lag = self._lags.setdefault(axis.name, Lag(time, position))
        went, wanted = lag.take(time, position, axis.command_velocity * axis.counts_per_radian)
        if time - lag.since < STALL_SECONDS:
            return
        del self._lags[axis.name]
        if abs(wanted) < 1 or went * math.copysign(1, wanted) >= STALL_RATIO * abs(wanted):
            return
        await axis.set_mode(Mode.IDLE)
        reason = f"moved {went} counts in {time - lag.since:.3f} s, commanded {wanted:.0f}; gone idle"
        self._report(axis.name, FaultKind.STALLED, reason)
