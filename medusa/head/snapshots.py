"""The state of all joints at one instant, once or as a stream."""

import asyncio
from collections.abc import AsyncIterator, Mapping
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, Flags, Inputs, Mode, Status


@dataclass(frozen=True)
class JointState:
    """One joint at `time` (loop, s). Angles are rad by the joint's sign, NaN while it is not homed."""

    time: float
    angle: float
    command_angle: float
    position_counts: int
    command_counts: int
    motor_command_counts: int
    inputs: Inputs
    status: Status
    flags: Flags
    mode: Mode
    homed: bool


@dataclass(frozen=True)
class HeadSnapshot:
    """All joints by name; the boards are asked at once, so `time` differs from a joint's by some ms at most."""

    time: float
    joints: dict[str, JointState]


class SnapshotReader:
    """Asks all boards at once and hands each joint its own part."""

    def __init__(self, axes: Mapping[str, Axis], boards: Mapping[int, Board]) -> None:
        self._axes = axes
        self._boards = boards
        self.latest: HeadSnapshot | None = None

    async def read(self) -> HeadSnapshot:
        """A snapshot of every joint; raises what the link raises when a board does not answer."""
        pending = [board.timed_snapshot() for board in self._boards.values()]
        answers = dict(zip(self._boards, await asyncio.gather(*pending), strict=True))
        joints = {}
        for name, axis in self._axes.items():
            snapshot, time = answers[axis.board.address]
            seen = snapshot.axes[axis.channel]
            axis.note(seen, time)
            joints[name] = JointState(
                time=time,
                angle=axis.to_angle(seen.actual),
                command_angle=axis.to_angle(seen.command),
                position_counts=seen.actual,
                command_counts=seen.command,
                motor_command_counts=seen.motor_command,
                inputs=seen.inputs,
                status=seen.status,
                flags=seen.flags,
                mode=seen.mode,
                homed=axis.homed,
            )
        self.latest = HeadSnapshot(min(joint.time for joint in joints.values()), joints)
        return self.latest

    async def stream(self, rate_hz: float) -> AsyncIterator[HeadSnapshot]:
        """Snapshots at a fixed rate against absolute deadlines; one that is late is not made up for."""
        if not 0 < rate_hz <= 1000:
            raise CommandError(f"a rate of {rate_hz:g} Hz is not in (0, 1000] Hz")
        loop = asyncio.get_running_loop()
        period = 1 / rate_hz
        due = loop.time()
        while True:
            yield await self.read()
            due += period
            now = loop.time()
            if due < now:
                due = now
            await asyncio.sleep(due - now)
