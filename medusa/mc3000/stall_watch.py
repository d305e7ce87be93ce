"""In proportional velocity mode the board supervises no following error: the host idles a joint that lags."""

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable, Mapping

from medusa.errors import MedusaError
from medusa.head.faults import Cause, Fault
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Mode

log = logging.getLogger(__name__)

STALL_SECONDS = 0.1
STALL_RATIO = 0.5
LOOK_SECONDS = 0.02
RETRY_SECONDS = 0.25


class Lag:
    """What a joint should have gone and went since a moment, counts."""

    def __init__(self, time: float, position: int) -> None:
        self.since = time
        self._start = position
        self._time = time
        self._wanted = 0.0

    def update(self, time: float, position: int, rate_counts_s: float) -> tuple[int, float]:
        """(went, wanted) after one more look, with the rate commanded since the last one."""
        self._wanted += rate_counts_s * (time - self._time)
        self._time = time
        return position - self._start, self._wanted


class StallWatch:
    """Watches the axes that turn in proportional velocity mode."""

    def __init__(self, axes: Mapping[str, Axis], report: Callable[[Fault], None]) -> None:
        self._axes = axes
        self._report = report
        self._lags: dict[str, Lag] = {}
        self._changed = asyncio.Event()
        self._task: asyncio.Task[None] | None = None
        for axis in axes.values():
            axis.rate_changed = self._changed.set

    def start(self) -> None:
        """Begin to watch."""
        if self._task is None:
            self._task = asyncio.get_running_loop().create_task(self._watch(), name="stall watch")

    async def end(self) -> None:
        """Watch no longer."""
        task, self._task = self._task, None
        if task is not None:
            task.cancel()
            await asyncio.gather(task, return_exceptions=True)

    async def _watch(self) -> None:
        while True:
            self._changed.clear()
            turning = [
                axis
                for axis in self._axes.values()
                if axis.mode is Mode.PROPORTIONAL_VELOCITY and axis.rate != 0
            ]
            if not turning:
                self._lags.clear()
                await self._changed.wait()
                continue
            try:
                for axis in turning:
                    await self._look(axis)
            except MedusaError as error:
                # The link reports the loss itself; the board's watchdog ends what nobody can watch.
                log.warning("joints in motion not read: %s", error)
                await asyncio.sleep(RETRY_SECONDS)
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(LOOK_SECONDS):
                    await self._changed.wait()

    async def _look(self, axis: Axis) -> None:
        snapshot, time = await axis.board.timed_snapshot()
        reading = snapshot.axes[axis.channel]
        axis.take_snapshot(reading, time)
        if axis.mode is not Mode.PROPORTIONAL_VELOCITY or axis.rate == 0:
            return
        lag = self._lags.setdefault(axis.name, Lag(time, reading.actual))
        went, wanted = lag.update(time, reading.actual, axis.rate * axis.counts_per_radian)
        if time - lag.since < STALL_SECONDS:
            return
        del self._lags[axis.name]
        if abs(wanted) < 1 or went * math.copysign(1, wanted) >= STALL_RATIO * abs(wanted):
            return
        await axis.set_mode(Mode.IDLE)
        reason = f"moved {went} counts in {time - lag.since:.3f} s, commanded {wanted:.0f}; gone idle"
        self._report(Fault(Cause.STALLED, (axis.name,), reason, asyncio.get_running_loop().time()))
