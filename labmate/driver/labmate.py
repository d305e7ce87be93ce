"""The Labmate as a base driver: its requests, readings and events in SI units."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Iterable, Mapping
from math import inf, radians
from typing import Any, Literal

from labmate.base.checks import check_free_way
from labmate.base.driver import BaseDriver, Capabilities, Kind
from labmate.base.events import UNTOUCHED, Bumper, Cause, LowBattery, Stopped, TravelEnded
from labmate.base.reading import BaseReading, WheelCounts
from labmate.config import BaseConfig, CalibrationFile
from labmate.driver import messages as m
from labmate.driver.clock import DeviceClock
from labmate.driver.connection import Connection
from labmate.odometry import Pose, WheelGeometry
from medusa.errors import (
    CommandError,
    ConfigError,
    DeviceRestarted,
    DeviceSilent,
    MedusaError,
    NoReply,
    ProtocolError,
)
from medusa.link import Event, Line, Operation

log = logging.getLogger(__name__)

_STOP_ATTEMPTS = 3
_REFUSED_FOR_ITS_STATE = (8, 9)
"""Status of a motion refused for what is latched or touched."""
_POLE = 0.032
"""Pole of the drive, 5 Hz (docs/protocols)."""
_VALID = 0.3
"""Longest validity (s) of one DRIVE; the base would take 2 s."""
_ARRIVAL = (2e-3, radians(0.1))
"""How well GO and TURN arrive by the base's own odometry, m and rad."""
_NOTICE = 0.05
"""An event is sent at once; a motion to be kept from the line's next poll, and a repeat or two."""

_SIDES = {
    m.Bumper.FRONT: Bumper.FRONT,
    m.Bumper.REAR: Bumper.REAR,
    m.Bumper.LEFT: Bumper.LEFT,
    m.Bumper.RIGHT: Bumper.RIGHT,
}
_TOUCHING = {
    m.Flags.FRONT_BUMPER: Bumper.FRONT,
    m.Flags.REAR_BUMPER: Bumper.REAR,
    m.Flags.LEFT_BUMPER: Bumper.LEFT,
    m.Flags.RIGHT_BUMPER: Bumper.RIGHT,
}
_LATCHES = {m.Flags.EMERGENCY_STOP: Cause.EMERGENCY_STOP, m.Flags.STALLED: Cause.STALLED}
_STOPS = {
    m.EVENT_EMERGENCY_STOP: Cause.EMERGENCY_STOP,
    m.EVENT_WATCHDOG: Cause.WATCHDOG,
    m.EVENT_STALLED: Cause.STALLED,
}
_ENDINGS = {ending: Cause[ending.name] for ending in m.Ending}


class Labmate(BaseDriver):
    """A Labmate at an address of a line. Without a configuration it can be read and stopped, not moved."""

    def __init__(
        self,
        line: Line,
        config: BaseConfig | None,
        *,
        path: str = "the line",
        address: int | None = None,
        calibration: CalibrationFile | None = None,
    ) -> None:
        super().__init__(path, None if config is None else config.motion_limits, _capabilities(config))
        if address is None:
            address = config.port.address if config is not None else m.DEFAULT_ADDRESS
        self.connection = Connection(
            line, path, config, address, on_event=self._take_event, on_loss=self._take_loss
        )
        self._calibration = calibration
        self._clock = DeviceClock()
        self._lost = False

    async def open(self) -> None:
        hello = await self.connection.open()
        part = m.HelloPart.decode(hello.part)
        if self._calibration is not None:
            try:
                self._calibration.check_belongs_to(part.wheel_base, part.counts_per_metre)
            except ConfigError:
                await self.connection.close(watchdog_off=True)
                raise
        self.wheels = WheelGeometry(part.wheel_base, 1.0, part.counts_per_metre)
        self.facts = {
            "wheel_base_mm": round(1e3 * part.wheel_base, 1),
            "counts_per_metre": part.counts_per_metre,
            "firmware": f"{hello.firmware >> 8}.{hello.firmware & 0xFF}",
            "boot_count": hello.boot_count,
        }
        self._lost = False

    async def close(self, *, at_rest: bool) -> None:
        await self.connection.close(watchdog_off=at_rest and not self._lost)

    async def read(self) -> BaseReading:
        """Pose, status and encoders, asked for together."""
        asked_at = asyncio.get_running_loop().time()
        request = self.connection.request
        replies = await asyncio.gather(request(m.POSE), request(m.STATUS), request(m.ENCODERS))
        pose, status = m.PoseReply.decode(replies[0]), m.StatusReply.decode(replies[1])
        counts = m.EncodersReply.decode(replies[2])
        own_pose = Pose(pose.x, pose.y, pose.heading)
        return BaseReading(
            time=asked_at,
            stamp=self._clock.seconds(pose.time_us),
            own_pose=own_pose,
            pose=own_pose,
            speed=pose.speed,
            turn_rate=pose.turn_rate,
            at_rest=status.at_rest,
            touching=_union(side for flag, side in _TOUCHING.items() if status.flags & flag),
            latched=frozenset(cause for flag, cause in _LATCHES.items() if status.flags & flag),
            battery=status.battery,
            battery_low=bool(status.flags & m.Flags.BATTERY_LOW),
            counts=WheelCounts(counts.left, counts.right, self._clock.seconds(counts.time_us)),
            details={
                "mode": status.mode.name.lower(),
                "moving": bool(status.flags & m.Flags.MOVING),
                "motor_power": bool(status.flags & m.Flags.MOTOR_POWER),
            },
        )

    async def twist(self, speed: float, turn_rate: float, valid: float) -> None:
        """DRIVE."""
        payload = m.Drive(speed, turn_rate, valid).encode()
        await self._move("DRIVE", m.DRIVE, payload, speed, turn_rate)

    async def travel(self, kind: Kind, amount: float) -> None:
        """GO or TURN."""
        if kind == "GO":
            await self._move(kind, m.GO, m.Go(amount).encode(), amount, 0.0)
        else:
            await self._move(kind, m.TURN, m.Turn(amount).encode(), 0.0, amount)

    async def stop(self) -> None:
        """STOP until it is answered: it may be sent as often as needed, unlike a motion.

        A base that knows no session (it restarted) gets a HELLO instead, which ramps it to a stop as well.
        """
        for left in reversed(range(_STOP_ATTEMPTS)):
            try:
                await self.connection.request(m.STOP)
            except (DeviceRestarted, CommandError):
                await self.connection.session.handshake()
                return
            except DeviceSilent:
                raise
            except NoReply as error:
                if not left:
                    raise
                log.warning("STOP: %s", error)
            else:
                return

    async def emergency_stop(self) -> None:
        """EMERGENCY_STOP to everything on the line, then to each address."""
        await self.connection.line.emergency_stop()

    async def clear(self) -> None:
        await self.connection.session.clear()

    async def set_pose(self, pose: Pose) -> None:
        await self.connection.request(m.SET_POSE, m.SetPose(pose.x, pose.y, pose.heading).encode())

    async def counters(self) -> Mapping[str, Any]:
        found = await self.connection.session.statistics()
        return {
            "frames": found.frames,
            "crc_errors": found.crc_errors,
            "framing_errors": found.framing_errors,
            "watchdog_trips": found.watchdog_trips,
        }

    async def _move(
        self,
        kind: Kind | Literal["DRIVE"],
        operation: Operation,
        payload: bytes,
        forward: float,
        turning: float,
    ) -> None:
        try:
            await self.connection.request(operation, payload)
        except CommandError as error:
            if error.status in _REFUSED_FOR_ITS_STATE:
                # Pressed or latched since the last reading: said in words.
                check_free_way(kind, await self.read(), forward, turning)
            raise

    def _take_event(self, event: Event) -> None:
        try:
            content = m.BaseEvent.decode(event.payload)
        except ProtocolError as error:
            log.error("event %02XH: %s", event.operation, error)
            return
        log.info("%s, detail %d", m.EVENT_NAMES.get(event.operation, "unknown event"), content.detail)
        stamp = self._clock.seconds(content.time_us)
        if event.operation == m.EVENT_MOTION_DONE:
            try:
                cause = _ENDINGS[m.Ending(content.detail)]
            except ValueError:
                log.error("a motion ended with detail %d, known are 0–5", content.detail)
                return
            self.publish(TravelEnded(cause, Pose(content.x, content.y, content.heading), stamp))
        elif event.operation == m.EVENT_BATTERY_LOW:
            self.publish(LowBattery(stamp))
        elif event.operation == m.EVENT_BUMPER:
            touching = _union(side for bit, side in _SIDES.items() if content.detail & bit)
            self.publish(Stopped(Cause.BUMPER, stamp, touching))
        elif event.operation in _STOPS:
            self.publish(Stopped(_STOPS[event.operation], stamp))

    def _take_loss(self, error: MedusaError) -> None:
        self._lost = True
        self.publish(Stopped.lost(error))


def _union(sides: Iterable[Bumper]) -> Bumper:
    found = UNTOUCHED
    for side in sides:
        found |= side
    return found


def _capabilities(config: BaseConfig | None) -> Capabilities:
    return Capabilities(
        watchdog=inf if config is None else config.safety.watchdog_ms * 1e-3,
        expires=_VALID,
        travels=True,
        twist_step=(m.TENTH_MM, m.CENTIDEGREE),
        arrival=_ARRIVAL,
        lag=_POLE,
        notice=_NOTICE,
        latch="device",
        bumpers=Bumper.FRONT | Bumper.REAR | Bumper.LEFT | Bumper.RIGHT,
    )
