"""What the base is asked for while it lives, and the host's own reckoning from it."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from labmate.base.checks import MAX_POSE_AGE, BaseSnapshot
from labmate.driver import messages as m
from labmate.driver.connection import Connection
from labmate.odometry import START, Odometry, OdometryNoise, Pose, WheelGeometry
from medusa.errors import CommandError, DeviceSilent, NoReply

_LOG = logging.getLogger(__name__)

_ATTEMPTS = 4


class Readings:
    """Snapshots of one base; every one carries the odometry on."""

    def __init__(self, connection: Connection, geometry: WheelGeometry, noise: OdometryNoise) -> None:
        self.latest: BaseSnapshot | None = None
        self._connection = connection
        self._odometry = Odometry(geometry, noise)
        self._sampled_us: int | None = None
        self._observers: list[Callable[[BaseSnapshot], None]] = []

    @property
    def geometry(self) -> WheelGeometry:
        """The wheels that the odometry reckons with."""
        return self._odometry.geometry

    async def snapshot(self) -> BaseSnapshot:
        """Pose, encoders and status, asked for together."""
        asked_at = asyncio.get_running_loop().time()
        request = self._connection.request
        replies = await asyncio.gather(request(m.POSE), request(m.STATUS), request(m.ENCODERS))
        pose, status = m.PoseReply.decode(replies[0]), m.StatusReply.decode(replies[1])
        counts = m.EncodersReply.decode(replies[2])
        # Behind a repeat an older reading may come after the younger one of another reader: its way is counted.
        if self._sampled_us is None or later(counts.time_us, self._sampled_us):
            self._odometry.step(counts.left, counts.right)
            self._sampled_us = counts.time_us
        self.latest = BaseSnapshot(
            asked_at,
            pose.time_us,
            Pose(pose.x, pose.y, pose.heading),
            pose.speed,
            pose.turn_rate,
            counts.left,
            counts.right,
            status.mode,
            status.flags,
            status.battery,
            self._odometry.pose,
            self._odometry.covariance,
        )
        for observer in list(self._observers):
            observer(self.latest)
        return self.latest

    async def patient_snapshot(self) -> BaseSnapshot:
        """A snapshot over a bad line: reading again harms nothing. Raises NoReply after a few attempts."""
        for _ in range(_ATTEMPTS - 1):
            try:
                return await self.snapshot()
            except DeviceSilent:
                raise
            except NoReply as error:
                _LOG.warning("reading the base: %s", error)
        return await self.snapshot()

    def steerable(self) -> BaseSnapshot:
        """The latest snapshot; raises StalePose when it is older than 200 ms."""
        if self.latest is None:
            raise CommandError("the base has not been read yet")
        self.latest.require_fresh(asyncio.get_running_loop().time(), MAX_POSE_AGE)
        return self.latest

    def observe(self, callback: Callable[[BaseSnapshot], None]) -> Callable[[], None]:
        """Call back with every snapshot, whoever asked for it; returns what ends it."""
        self._observers.append(callback)
        return lambda: self._observers.remove(callback)

    def restart_odometry(self, pose: Pose = START) -> None:
        """Reckon from this pose on; what was read before is void."""
        self._odometry = Odometry(self._odometry.geometry, self._odometry.noise, pose)
        self._sampled_us = None
        self.latest = None


def later(time_us: int, than_us: int) -> bool:
    """Whether a device stamp is after another one, across the wrap of 71 minutes."""
    return 0 < ((time_us - than_us) & 0xFFFFFFFF) < 0x80000000
