"""A machine under a contract: how a host opens it, its truth from outside, what can happen to it."""

import asyncio
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, asynccontextmanager
from dataclasses import dataclass

import pytest

from labmate.base import MobileBase, Motion
from labmate.errors import MotionStopped
from labmate.odometry import Pose

INCIDENTS = frozenset(
    {
        "front bumper pressed",
        "front bumper released",
        "emergency stop pressed",
        "emergency stop released",
        "wheels held",
        "wheels released",
        "host not heard for 0.8 s",
        "what the machine sends is lost for 2 s",
        "line lost",
        "line back",
        "restart",
        "host suspended for an hour",
    }
)
SHARE = 0.8
"""Of the limits, for what is driven by twists."""
LOOK = 0.1
"""Two looks at the base in 50 ms, s: how late a confirmation may be."""


@dataclass(frozen=True)
class Truth:
    """Where the machine really is and how it really moves; m, rad, m/s, rad/s."""

    pose: Pose
    speed: float
    turn_rate: float

    @property
    def moving(self) -> bool:
        return self.speed != 0.0 or self.turn_rate != 0.0


@dataclass
class World:
    """One machine under test: how a host opens it, the truth about it, and what can happen to it."""

    open: Callable[[], AbstractAsyncContextManager[MobileBase]]
    truth: Callable[[], Truth]
    incidents: Mapping[str, Callable[[], None]]

    def happen(self, name: str) -> None:
        """Disturb the machine; skips the test where it cannot be disturbed so."""
        if name not in self.incidents:
            pytest.skip(f"no incident: {name}")
        self.incidents[name]()

    def require(self, *names: str) -> None:
        """Skip before anything is begun."""
        for name in names:
            if name not in self.incidents:
                pytest.skip(f"no incident: {name}")

    async def record(self, seconds: float, every: float = 0.01) -> list[Truth]:
        """The truth over a time."""
        found = [self.truth()]
        for _ in range(round(seconds / every)):
            await asyncio.sleep(every)
            found.append(self.truth())
        return found

    async def assert_stays(self, seconds: float = 1.5) -> None:
        """Nothing moves, not a hair, for a time."""
        poses = {truth.pose for truth in await self.record(seconds, 0.05)}
        assert len(poses) == 1

    async def assert_rests_within(self, seconds: float) -> None:
        """It comes to rest within a time, and stays."""
        await asyncio.sleep(seconds)
        assert not self.truth().moving
        await self.assert_stays()


@asynccontextmanager
async def moving(world: World, base: MobileBase, turn_rate: float = 0.0) -> AsyncIterator[Motion]:
    """A motion at speed, held for longer than the body takes: what ends it is what the test does."""
    limits = base.limits
    async with base.motion(hold=2.0) as motion:
        motion.twist(SHARE * limits.speed, turn_rate)
        await asyncio.sleep(SHARE * limits.stop_seconds + 5.0 * base.can.lag + 0.2)
        assert world.truth().speed > 0.5 * limits.speed
        motion.twist(SHARE * limits.speed, turn_rate)
        yield motion


@asynccontextmanager
async def ended(reason: str) -> AsyncIterator[None]:
    """The motion inside is expected to end for this reason."""
    with pytest.raises(MotionStopped) as stopped:
        yield
    assert stopped.value.reason == reason


def ramp(base: MobileBase) -> float:
    """Time to come to rest by its ramp: the limits', the body's lag (six of it: 0.25 %), two looks."""
    return base.limits.stop_seconds + 6.0 * base.can.lag + LOOK + base.can.notice


def block(seconds: float) -> None:
    """The event loop's own work takes a while; on a virtual loop, which has `block`."""
    asyncio.get_running_loop().block(seconds)  # type: ignore[attr-defined]
