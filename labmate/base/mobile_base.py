"""A mobile base as a program drives it: metres, radians, and a machine at rest when the program is gone."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable, Coroutine
from math import isfinite
from types import TracebackType
from typing import Any, Self

from labmate.base import stopping
from labmate.base.checks import check_twist
from labmate.base.driver import BaseDriver, Capabilities, Kind, Limits
from labmate.base.events import Cause, Event, LowBattery, Stopped
from labmate.base.motion import Motion
from labmate.base.reading import BaseReading
from labmate.base.readings import Readings
from labmate.base.report import MotionReport
from labmate.base.travel import Travel
from labmate.base.twist_travel import travel_by_twists
from labmate.calibration import Calibration
from labmate.errors import MotionStopped
from labmate.odometry import UNCALIBRATED, Odometry, OdometryNoise, Pose, WheelGeometry
from medusa.errors import CommandError, DeviceFault, DeviceRestarted, HostGap, MedusaError

log = logging.getLogger(__name__)

_UNKNOWN_RAMP = 5.0
"""Time for a stop (s) when the limits are not ours: an earlier host may have set a slow ramp."""
_FASTEST_READINGS_HZ = 50.0


class MobileBase:
    """A mobile base: `async with MobileBase(driver) as base`. Leaving it leaves the base at rest, confirmed.

    `calibration`, `noise`: what the host's odometry reckons with, where the driver counts wheels; without a
    calibration with what the base reports of itself. `poll_period`: how often a GO or TURN under way is read, s.

    Raises PortError (no base there, line gone), CommandError (refused, nothing moved), MotionStopped (bumper,
    emergency stop, stall, watchdog, STOP, lost line, restart), StopNotConfirmed, StalePose.
    """

    def __init__(
        self,
        driver: BaseDriver,
        *,
        calibration: Calibration | None = None,
        noise: OdometryNoise = UNCALIBRATED,
        poll_period: float = 0.25,
    ) -> None:
        self.driver = driver
        self.calibration = calibration
        self.poll_period = poll_period
        self._noise = noise
        self._readings: Readings | None = None
        self._motion: Motion | Travel | None = None
        self._lost: MedusaError | None = None
        self._stops_under_way = 0
        self._unsubscribe: Callable[[], None] = lambda: None

    async def __aenter__(self) -> Self:
        await self.driver.open()
        self._unsubscribe = self.driver.subscribe(self._take_event)
        try:
            self._readings = Readings(self.driver, self._new_odometry())
            await self.read()
        except BaseException:
            self._unsubscribe()
            await self.driver.close(at_rest=True)
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        await stopping.with_error(error, stopping.carry_through(self._leave()))

    @property
    def can(self) -> Capabilities:
        """What the machine can do."""
        return self.driver.can

    @property
    def limits(self) -> Limits:
        """The configured limits; raises CommandError without a configuration."""
        if self.driver.limits is None:
            raise CommandError(
                "motion needs a configuration with limits and watchdog (--config); labmate-drive init writes one"
            )
        return self.driver.limits

    @property
    def wheels(self) -> WheelGeometry:
        """The wheels as the base itself computes with them; raises CommandError where it counts none."""
        if self.driver.wheels is None:
            raise CommandError(f"{self.driver.name} counts no wheels, or is not open")
        return self.driver.wheels

    @property
    def geometry(self) -> WheelGeometry:
        """The wheels with which the host's odometry reckons: calibrated, if the base is."""
        return (
            self.wheels
            if self.calibration is None
            else self.calibration.geometry(self.wheels.counts_per_metre)
        )

    async def read(self) -> BaseReading:
        """Read pose, speed and state now."""
        return await self._open_readings.read()

    async def read_patiently(self) -> BaseReading:
        """Read over a bad line; raises NoReply after a few attempts."""
        return await self._open_readings.read_patiently()

    async def readings(self, rate_hz: float) -> AsyncIterator[BaseReading]:
        """A stream of readings; a line that repeats makes it late, never double."""
        if not 0.0 < rate_hz <= _FASTEST_READINGS_HZ:
            raise CommandError(f"readings come at up to {_FASTEST_READINGS_HZ:.0f} Hz, not at {rate_hz}")
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            yield await self.read()
            due = max(due + 1.0 / rate_hz, loop.time())
            await asyncio.sleep(due - loop.time())

    def steerable(self) -> BaseReading:
        """The latest reading; raises StalePose when it is older than 200 ms."""
        return self._open_readings.steerable()

    def observe(self, callback: Callable[[BaseReading], None]) -> Callable[[], None]:
        """Call back with every reading, whoever asked for it; returns what ends it."""
        return self._open_readings.observe(callback)

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Call back with everything that the base reports on its own; returns what ends it."""
        return self.driver.subscribe(callback)

    async def go(self, distance: float) -> MotionReport:
        """Drive straight by `distance` m (negative: backwards); cancelling it stops the base."""
        return await self._travel("GO", distance)

    async def turn(self, angle: float) -> MotionReport:
        """Turn on the spot by `angle` rad (positive: left); cancelling it stops the base."""
        return await self._travel("TURN", angle)

    def motion(self, hold: float = 0.5) -> Motion:
        """Drive by twists while the calling task lives, each held for at most `hold` s."""
        return Motion(self, hold)

    async def twist(
        self, speed: float, turn_rate: float, valid: float | None = None, *, motion: Motion | None = None
    ) -> None:
        """One twist at `speed` m/s and `turn_rate` rad/s for `valid` s (at most, and unless given, `can.expires`)."""
        valid = self.can.expires if valid is None else valid
        check_twist(self.limits, self.can.expires, speed, turn_rate, valid)
        self.require_ready()
        if self._motion is not motion:
            raise CommandError("the base is already being moved: one motion at a time")
        await self.driver.twist(speed, turn_rate, valid)

    async def set_pose(self, pose: Pose) -> None:
        """Set the pose of the base, at rest, and of the host's odometry."""
        await self.driver.set_pose(pose)
        self._open_readings.restart_odometry(pose)
        await self.read()

    async def stop(self) -> BaseReading:
        """Ramp to a stop and confirm it by reading back, although the caller is cancelled meanwhile.

        Raises StopNotConfirmed, after sending an emergency stop where the line still takes one.
        """
        limits = self.driver.limits
        ramp = _UNKNOWN_RAMP if limits is None else limits.stop_seconds
        stop = stopping.stop(self.driver, self._open_readings, ramp)
        return await self._end_motion(Cause.STOP, "STOP was called", stop)

    async def emergency_stop(self) -> BaseReading:
        """Stop at once, latch it and confirm it; raises StopNotConfirmed."""
        stop = stopping.emergency_stop(self.driver, self._open_readings)
        return await self._end_motion(Cause.EMERGENCY_STOP, "emergency stop was called", stop)

    async def clear(self) -> BaseReading:
        """Release a latched emergency stop; what is left is in the reading. Nothing moves."""
        await self.driver.clear()
        return await self.read()

    async def recover(self) -> BaseReading:
        """Make the base fit to move again after a lost line, a restart or a gap.

        After a restart the base reckons from where it lost its memory, and so does the host from now on.
        """
        await self.driver.open()
        restarted = isinstance(self._lost, DeviceRestarted)
        self._lost = None
        log.info("%s: the base is ready again", self.driver.name)
        reading = await self.read()
        if restarted:
            self._open_readings.restart_odometry(reading.own_pose)
            reading = await self.read()
        return reading

    def require_ready(self) -> None:
        """Raise what makes motion impossible now: a loss since the driver was opened, or a stop under way."""
        if self._stops_under_way:
            raise CommandError("the base is being stopped; nothing moves before it is at rest")
        if isinstance(self._lost, DeviceRestarted):
            raise DeviceRestarted(
                f"{self._lost}; its pose is invalid: recover() before it moves",
                before=self._lost.before,
                now=self._lost.now,
            ) from self._lost
        if self._lost is not None:
            raise DeviceFault(f"{self._lost}; recover() before it moves") from self._lost

    def begin(self, motion: Motion | Travel) -> None:
        """Give the base to one motion; raises CommandError when it is taken."""
        _ = self.limits
        self.require_ready()
        if self._motion is not None:
            raise CommandError("the base is already being moved: one motion at a time")
        self._motion = motion

    def end(self, motion: Motion | Travel) -> None:
        """Take the base back."""
        if self._motion is motion:
            self._motion = None

    async def _travel(self, kind: Kind, amount: float) -> MotionReport:
        if not isfinite(amount):
            raise CommandError(f"{kind} needs a finite number, not {amount}")
        if not self.can.travels:
            return await travel_by_twists(self, kind, amount)
        travel = Travel(kind, amount, self.driver, self._open_readings, self.poll_period)
        self.begin(travel)
        try:
            return await travel.run()
        except BaseException as error:
            # Cancelled, or it may travel on unnoticed: nobody would watch it. One out of reach its watchdog stops.
            if travel.may_move and not self._out_of_reach:
                await stopping.with_error(error, self.stop())
            raise
        finally:
            self.end(travel)

    async def _end_motion(
        self, cause: Cause, words: str, stop: Coroutine[Any, Any, BaseReading]
    ) -> BaseReading:
        """Stop, and let nothing move meanwhile."""
        self._stops_under_way += 1
        try:
            if self._motion is not None:
                self._motion.stop_called(MotionStopped(f"the motion ended: {words}", reason=cause.value))
            return await stopping.carry_through(stop)
        finally:
            self._stops_under_way -= 1

    async def _leave(self) -> None:
        at_rest = False
        try:
            await self.stop()
            at_rest = True
        finally:
            self._unsubscribe()
            await self.driver.close(at_rest=at_rest)

    @property
    def _out_of_reach(self) -> bool:
        return self._lost is not None and not isinstance(self._lost, HostGap)

    @property
    def _open_readings(self) -> Readings:
        if self._readings is None:
            raise CommandError("the base is not open")
        return self._readings

    def _new_odometry(self) -> Odometry | None:
        return None if self.driver.wheels is None else Odometry(self.geometry, self._noise)

    def _take_event(self, event: Event) -> None:
        if isinstance(event, LowBattery):
            log.warning("the battery is low: no new GO is begun")
        if isinstance(event, Stopped) and event.error is not None:
            self._lose(event.error)
            if self._motion is not None:
                self._motion.fail(event.ending())
        elif self._motion is not None:
            self._motion.take_event(event)

    def _lose(self, error: MedusaError) -> None:
        if not isinstance(self._lost, DeviceRestarted):
            self._lost = error
        if isinstance(error, DeviceRestarted) and self._readings is not None:
            self._readings.restart_odometry()
