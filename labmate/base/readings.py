"""Readings of one base, the host's own dead reckoning from them, and who watches."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from dataclasses import replace

from labmate.base.driver import BaseDriver
from labmate.base.reading import BaseReading
from labmate.odometry import START, Odometry, Pose
from medusa.errors import CommandError, DeviceSilent, NoReply

log = logging.getLogger(__name__)

_ATTEMPTS = 4


class Readings:
    """Readings of one base; each carries the odometry on, where the base counts its wheels.

    `odometry` None: the driver's own pose is the best that is known.
    """

    def __init__(self, driver: BaseDriver, odometry: Odometry | None) -> None:
        self.latest: BaseReading | None = None
        self._driver = driver
        self._odometry = odometry
        self._sampled: float | None = None
        self._observers: list[Callable[[BaseReading], None]] = []

    async def read(self) -> BaseReading:
        """Read the base now."""
        reading = await self._driver.read()
        counts, odometry = reading.counts, self._odometry
        if odometry is not None and counts is not None:
            # Behind a repeat an older reading may come after the younger one of another reader: its way is counted.
            if self._sampled is None or counts.stamp > self._sampled:
                odometry.step(counts.left, counts.right)
                self._sampled = counts.stamp
            reading = replace(reading, pose=odometry.pose, covariance=odometry.covariance)
        self.latest = reading
        for observer in list(self._observers):
            observer(reading)
        return reading

    async def read_patiently(self) -> BaseReading:
        """Read over a bad line: reading again harms nothing. Raises NoReply after a few attempts."""
        for _ in range(_ATTEMPTS - 1):
            try:
                return await self.read()
            except DeviceSilent:
                raise
            except NoReply as error:
                log.warning("reading the base: %s", error)
        return await self.read()

    def steerable(self) -> BaseReading:
        """Return the latest reading; raises StalePose when it is older than 200 ms."""
        if self.latest is None:
            raise CommandError("the base has not been read yet")
        self.latest.require_fresh(asyncio.get_running_loop().time())
        return self.latest

    def observe(self, callback: Callable[[BaseReading], None]) -> Callable[[], None]:
        """Call back with every reading, whoever asked for it; returns what ends it."""
        self._observers.append(callback)
        return lambda: self._observers.remove(callback)

    def restart_odometry(self, pose: Pose = START) -> None:
        """Reckon from this pose on; what was read before is invalid."""
        if self._odometry is not None:
            self._odometry = Odometry(self._odometry.geometry, self._odometry.noise, pose)
        self._sampled = None
        self.latest = None
