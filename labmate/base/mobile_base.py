"""The base as a program sees it: metres, radians, and a machine that stands when the program is gone."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from types import TracebackType
from typing import Self

from labmate.base import stopping
from labmate.base.checks import (
    MAX_VALID,
    BaseSnapshot,
    Kind,
    MotionReport,
    bumpers_in_words,
    check_drive,
    check_free_way,
    stop_seconds,
)
from labmate.base.motion import Steering
from labmate.base.readings import Readings
from labmate.base.travel import Travel
from labmate.calibration import Calibration
from labmate.config import BaseConfig, CalibrationFile, OdometryConfig, read_calibration
from labmate.driver import messages as m
from labmate.driver.connection import Connection
from labmate.driver.messages import BaseEvent, Bumper, HelloPart, Limits
from labmate.errors import MotionStopped, out_of_reach
from labmate.odometry import OdometryNoise, Pose, WheelGeometry
from medusa.errors import CommandError, DeviceRestarted, MedusaError, ProtocolError
from medusa.link import Event, Line, Trace

_LOG = logging.getLogger(__name__)

_UNKNOWN_RAMP = 5.0
"""Time for a stop (s) when the limits are not ours: an earlier host may have set a slow ramp."""


class Base:
    """A Labmate base: `async with Base(line, config) as base`. Leaving it leaves the base standing.

    Without a configuration it can be read and stopped, not moved. Raises PortError (no base there, line gone),
    CommandError (refused, nothing moved), MotionStopped (bumper, emergency stop, stall, watchdog, STOP, lost
    line, restart), StopNotConfirmed, StalePose.
    """

    def __init__(
        self,
        line: Line,
        config: BaseConfig | None,
        *,
        path: str = "the line",
        address: int | None = None,
        calibration: CalibrationFile | None = None,
        poll_period: float = 0.25,
    ) -> None:
        if address is None:
            address = config.port.address if config is not None else m.DEFAULT_ADDRESS
        self.connection = Connection(
            line, path, config, address, on_event=self._take_event, on_trouble=self._take_trouble
        )
        self.config = config
        self.poll_period = poll_period
        """How often a GO or TURN under way is looked at, s."""
        self._calibration = calibration
        self._hello: HelloPart | None = None
        self._readings: Readings | None = None
        self._listeners: list[Callable[[int, BaseEvent], None]] = []
        self._travel: Travel | None = None
        self._steering: Steering | None = None

    async def __aenter__(self) -> Self:
        if self._calibration is None and self.config is not None and self.config.calibration_path is not None:
            self._calibration = read_calibration(self.config.calibration_path)
        self._hello = await self.connection.open()
        try:
            self._readings = Readings(self.connection, *self._geometry_and_noise(self._hello))
            await self.snapshot()
        except BaseException:
            await self.connection.close(standing=True)
            raise
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        standing = False
        try:
            await self.stop()
            standing = True
        except MedusaError as failed:
            if error is None or isinstance(error, asyncio.CancelledError):
                raise
            error.add_note(str(failed))
        finally:
            await self.connection.close(standing=standing)

    @property
    def hello(self) -> HelloPart:
        """Nominal wheel base and counts per metre."""
        if self._hello is None:
            raise CommandError("the base is not open")
        return self._hello

    @property
    def readings(self) -> Readings:
        """The snapshots, the odometry, and who watches them."""
        if self._readings is None:
            raise CommandError("the base is not open")
        return self._readings

    @property
    def calibration(self) -> Calibration | None:
        """What the host's odometry was calibrated to; None: it reckons with what the base says of itself."""
        return None if self._calibration is None else self._calibration.value

    @property
    def limits(self) -> Limits:
        """The configured limits; raises CommandError without a configuration."""
        if self.config is None:
            raise CommandError(
                "motion needs a configuration with limits and watchdog (--config); labmate-drive init writes one"
            )
        return self.config.wire_limits

    async def snapshot(self) -> BaseSnapshot:
        """Pose, encoders and status now."""
        return await self.readings.snapshot()

    async def snapshots(self, rate_hz: float) -> AsyncIterator[BaseSnapshot]:
        """A stream of snapshots; a line that repeats makes it late, never double."""
        if not 0.0 < rate_hz <= 50.0:
            raise CommandError(f"snapshots come at up to 50 Hz, not at {rate_hz}")
        loop = asyncio.get_running_loop()
        due = loop.time()
        while True:
            yield await self.snapshot()
            due = max(due + 1.0 / rate_hz, loop.time())
            await asyncio.sleep(due - loop.time())

    def listen(self, callback: Callable[[int, BaseEvent], None]) -> Callable[[], None]:
        """Call back with every event's operation and content; returns what ends it."""
        self._listeners.append(callback)
        return lambda: self._listeners.remove(callback)

    async def go(self, distance: float) -> MotionReport:
        """Drive straight by `distance` m (negative: backwards); cancelling it stops the base."""
        return await self._move("GO", distance)

    async def turn(self, angle: float) -> MotionReport:
        """Turn on the spot by `angle` rad (positive: left); cancelling it stops the base."""
        return await self._move("TURN", angle)

    async def drive(
        self, speed: float, turn_rate: float, valid: float = MAX_VALID, *, steering: Steering | None = None
    ) -> None:
        """One DRIVE at `speed` m/s and `turn_rate` rad/s, valid for at most 0.3 s; then the base ramps down."""
        check_drive(self.limits, speed, turn_rate, valid)
        self.connection.require_ready()
        if self._steering is not steering:
            raise CommandError("somebody else steers the base")
        try:
            await self.connection.request(m.DRIVE, m.Drive(speed, turn_rate, valid).encode())
        except CommandError as error:
            if error.status in (8, 9):
                check_free_way("DRIVE", (await self.snapshot()).flags, speed, turn_rate)
            raise

    def steer(self, hold: float = 0.5) -> Steering:
        """Keep a DRIVE alive while the calling task lives, each command for at most `hold` s."""
        return Steering(self, hold)

    async def set_pose(self, pose: Pose) -> None:
        """Tell the standing base, and the host's odometry, where it is."""
        await self.connection.request(m.SET_POSE, m.SetPose(pose.x, pose.y, pose.heading).encode())
        self.readings.restart_odometry(pose)
        await self.snapshot()

    async def stop(self) -> BaseSnapshot:
        """Ramp to a stop and confirm it by reading back.

        Raises StopNotConfirmed, after sending an emergency stop where the line still takes one.
        """
        self._revoke("stop", "STOP was called")
        ramp = _UNKNOWN_RAMP if self.config is None else stop_seconds(self.config.wire_limits)
        return await stopping.stop(self.connection, self.readings, ramp)

    async def emergency_stop(self) -> BaseSnapshot:
        """Stop at once, latch it and confirm it; raises StopNotConfirmed."""
        self._revoke("emergency stop", "emergency stop was called")
        return await stopping.emergency_stop(self.connection, self.readings)

    async def clear(self) -> BaseSnapshot:
        """Release a latched emergency stop; what is left is in the snapshot's flags. Nothing moves."""
        await self.connection.session.clear()
        return await self.snapshot()

    async def recover(self) -> BaseSnapshot:
        """Make the base fit to move again after a lost line or a restart.

        After a restart the base reckons from where it lost its memory, and so does the host from now on.
        """
        restarted = self.connection.restarted
        self._hello = await self.connection.recover()
        snapshot = await self.snapshot()
        if restarted:
            self.readings.restart_odometry(snapshot.pose)
            snapshot = await self.snapshot()
        return snapshot

    def begin_steering(self, steering: Steering) -> None:
        """Give the wheel to one steering; raises CommandError when it is taken."""
        self._require_free()
        self._steering = steering

    def end_steering(self, steering: Steering) -> None:
        """Take the wheel back."""
        if self._steering is steering:
            self._steering = None

    async def _move(self, kind: Kind, commanded: float) -> MotionReport:
        self._require_free()
        travel = Travel(kind, commanded, self.connection, self.readings, self.poll_period)
        self._travel = travel
        try:
            return await travel.run()
        except MotionStopped:
            # It stands, or it is out of reach and its watchdog stops it.
            raise
        except BaseException:
            # Cancelled, or it may have begun unseen: nobody would watch it.
            if travel.may_move:
                await self._stop_quietly()
            raise
        finally:
            self._travel = None

    def _require_free(self) -> None:
        _ = self.limits
        self.connection.require_ready()
        if self._travel is not None or self._steering is not None:
            raise CommandError("the base is already being moved: one motion at a time")

    async def _stop_quietly(self) -> None:
        try:
            await self.stop()
        except MedusaError as error:
            _LOG.error("%s", error)

    def _take_event(self, event: Event) -> None:
        try:
            content = BaseEvent.decode(event.payload)
        except ProtocolError as error:
            _LOG.error("event %02XH: %s", event.operation, error)
            return
        _LOG.info("%s, detail %d", m.EVENT_NAMES.get(event.operation, "unknown event"), content.detail)
        if self._travel is not None:
            self._travel.take_event(event.operation, content)
        if event.operation == m.EVENT_BUMPER:
            self._revoke("bumper", f"the {bumpers_in_words(Bumper(content.detail))} bumper was pressed")
        elif event.operation == m.EVENT_EMERGENCY_STOP:
            self._revoke("emergency stop", "emergency stop")
        elif event.operation == m.EVENT_WATCHDOG:
            self._revoke("watchdog", "the base's watchdog expired")
        elif event.operation == m.EVENT_STALLED:
            self._revoke("stalled", "the wheels stalled")
        elif event.operation == m.EVENT_BATTERY_LOW:
            _LOG.warning("the battery is low: no new GO is begun")
        for listener in list(self._listeners):
            listener(event.operation, content)

    def _take_trouble(self, error: MedusaError) -> None:
        if isinstance(error, DeviceRestarted) and self._readings is not None:
            self._readings.restart_odometry()
        stopped = out_of_reach(error)
        if self._steering is not None:
            self._steering.revoke(stopped)
        if self._travel is not None:
            self._travel.fail(stopped)

    def _revoke(self, reason: str, told: str) -> None:
        if self._steering is not None:
            self._steering.revoke(MotionStopped(f"steering ended: {told}", reason=reason))

    def _geometry_and_noise(self, hello: HelloPart) -> tuple[WheelGeometry, OdometryNoise]:
        trust = OdometryConfig() if self.config is None else self.config.odometry
        counts = float(hello.counts_per_metre)
        if self._calibration is None:
            return WheelGeometry(hello.wheel_base, 1.0, counts), trust.uncalibrated
        self._calibration.check_belongs_to(hello.wheel_base, hello.counts_per_metre)
        value = self._calibration.value
        return value.geometry(counts), value.noise(trust.wheel_noise)


@asynccontextmanager
async def open_base(
    path: str,
    config: BaseConfig | None,
    *,
    calibration: CalibrationFile | None = None,
    trace: Trace | None = None,
    poll_period: float = 0.25,
    seed: int | None = None,
    name: str | None = None,
) -> AsyncIterator[Base]:
    """Open a line with one base on it, and the base; leaving it leaves the base standing.

    `name`: what messages call it (default: the path). `seed`: for repeatable runs against an emulator.
    """
    baud = 115200 if config is None else config.port.baud
    async with (
        Line(path, baud=baud, trace=trace, name="labmate", seed=seed) as line,
        Base(line, config, path=name or path, calibration=calibration, poll_period=poll_period) as base,
    ):
        yield base
