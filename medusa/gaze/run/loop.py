"""The thin loop beside the gaze behaviours: cameras in, joints out, and a head at rest whatever ends it."""

import asyncio
import contextlib
import logging
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from medusa.completion import run_to_completion
from medusa.errors import MedusaError
from medusa.gaze.command import Command, GazeLimits, Hold, Position, Pursue, Saccade, Sighting, Velocity
from medusa.gaze.report.track_log import TrackLog
from medusa.gaze.retina import Retina
from medusa.gaze.run.joint_history import JointHistory
from medusa.head.drive import JointTraits, Reading
from medusa.head.faults import Fault, JointFault
from medusa.head.joint_group import JointGroup
from medusa.kinematics import Joints
from perception.camera.frame import Camera
from perception.camera.pairing import FramePair, paired

log = logging.getLogger(__name__)

LIMIT_MARGIN = math.radians(1.0)
"""The gaze stays this far inside the soft limits, where the axes would refuse or stop."""


class Gaze(Protocol):
    """A gaze behaviour: pure; it receives the time and what was seen."""

    def step(self, now: float, joints: Joints, sighting: Sighting | None) -> Command | None: ...

    def saccade_ended(self, now: float) -> None: ...


class PairListener(Protocol):
    """Whoever wants every pair of images, and what the loop saw in those that it used."""

    def add_pair(self, pair: FramePair) -> None: ...

    def add_sighting(self, pair: FramePair, sighting: Sighting) -> None: ...


@dataclass(frozen=True)
class LoopSettings:
    """Times in seconds.

    command_period: the longest time between two looks at the head, each with its commands; a picture brings
    one at once. pair_bound: two pictures exposed at most so far apart are a pair; pair_patience: how long one
    waits for the other. too_late: an older frame is not used any more. search: where to look, in turn, for
    a target that was not seen for search_after.
    """

    command_period: float = 0.02
    pair_bound: float = 0.005
    pair_patience: float = 0.03
    too_late: float = 0.6
    search: Sequence[Joints] = ()
    search_after: float = 1.0


def gaze_limits(traits: Mapping[str, JointTraits]) -> GazeLimits:
    """What the joints' traits allow a gaze, a margin inside the soft limits."""
    return GazeLimits(
        Joints.from_axes({name: joint.low + LIMIT_MARGIN for name, joint in traits.items()}),
        Joints.from_axes({name: joint.high - LIMIT_MARGIN for name, joint in traits.items()}),
        Joints.from_axes({name: joint.speed for name, joint in traits.items()}),
        Joints.from_axes({name: joint.acceleration for name, joint in traits.items()}),
    )


def least_speeds(traits: Mapping[str, JointTraits]) -> Joints:
    """The least rate of each joint [rad/s]: what a velocity command cannot go below."""
    return Joints.from_axes({name: joint.rate_step for name, joint in traits.items()})


class GazeLoop:
    """Runs one behaviour on an enabled and homed head with two cameras."""

    def __init__(
        self,
        head: JointGroup,
        cameras: tuple[Camera, Camera],
        retina: Retina,
        gaze: Gaze,
        settings: LoopSettings | None = None,
        *,
        listener: PairListener | None = None,
    ) -> None:
        self.head = head
        self.log = TrackLog()
        self._cameras = cameras
        self._retina = retina
        self._gaze = gaze
        self._settings = settings or LoopSettings()
        self._listener = listener
        self._history = JointHistory()
        self._pairs: asyncio.Queue[FramePair] = asyncio.Queue()
        self._news = asyncio.Event()
        self._fault: Fault | None = None
        self._blind_until = -math.inf
        self._last_seen = -math.inf
        self._searched = 0

    async def run(self, seconds: float) -> TrackLog:
        """Gaze for so long; the head has been stopped, and that confirmed, when this returns or raises.

        Raises JointFault when the head stops by itself, CameraError when both cameras are down, and what the
        link raises.
        """
        loop = asyncio.get_running_loop()
        end_faults = self.head.subscribe(self._take_fault)
        pump = loop.create_task(self._pump(), name="pair pictures")
        try:
            await self._run(loop.time() + seconds, pump)
        except BaseException:
            try:
                await run_to_completion(self.head.stop())
            except MedusaError as error:
                log.error("%s", error)
            raise
        else:
            await run_to_completion(self.head.stop())
        finally:
            end_faults()
            pump.cancel()
            await asyncio.gather(pump, return_exceptions=True)
        return self.log

    async def _run(self, end: float, pump: "asyncio.Task[None]") -> None:
        loop = asyncio.get_running_loop()
        due = self._last_seen = loop.time()
        while loop.time() < end:
            if self._fault is not None:
                raise JointFault(self._fault)
            if pump.done():
                pump.result()
            reading = await self.head.read()
            self._history.add(reading.time, Joints.from_axes({n: j.angle for n, j in reading.joints.items()}))
            await self._decide(reading)
            if loop.time() >= due:
                due = max(due + self._settings.command_period, loop.time())
            if self._pairs.empty():
                # A picture is acted on when it comes, not when the next command would have been due.
                with contextlib.suppress(TimeoutError):
                    async with asyncio.timeout_at(due):
                        await self._news.wait()
            self._news.clear()

    async def _decide(self, reading: Reading) -> None:
        loop = asyncio.get_running_loop()
        sighting = self._newest_sighting()
        joints = Joints.from_axes({name: joint.commanded for name, joint in reading.joints.items()})
        command = self._gaze.step(reading.time, joints, sighting)
        if sighting is not None and sighting.seen:
            self._last_seen, self._searched = loop.time(), 0
        unseen = loop.time() - self._last_seen
        if isinstance(command, Hold) and self._settings.search and unseen > self._settings.search_after:
            command = Saccade(
                self._settings.search[self._searched % len(self._settings.search)], "search for a target"
            )
            self._searched += 1
        if command is not None:
            await self._apply(command, reading)
        if sighting is not None:
            self.log.add(sighting, loop.time(), type(command).__name__.lower())

    def _newest_sighting(self) -> Sighting | None:
        """The newest pair's, made from where the joints stood at its exposure; none of a saccade, none too old."""
        newest = None
        now = asyncio.get_running_loop().time()
        while not self._pairs.empty():
            pair = self._pairs.get_nowait()
            joints = self._history.at(pair.stamp)
            if pair.stamp < self._blind_until or joints is None:
                self.log.blind_frames += 1
            elif now - pair.stamp > self._settings.too_late:
                self.log.late_frames += 1
            else:
                newest = self._retina.look(pair, joints)
                if self._listener is not None:
                    self._listener.add_sighting(pair, newest)
        return newest

    async def _apply(self, command: Command, reading: Reading) -> None:
        if isinstance(command, Saccade):
            await self._saccade(command)
        elif isinstance(command, Hold):
            self.log.holds.append((asyncio.get_running_loop().time(), command.reason))
            await self._drive({name: 0.0 for name, joint in reading.joints.items() if joint.rate})
        else:
            await self._pursue(command)

    async def _saccade(self, command: Saccade) -> None:
        loop = asyncio.get_running_loop()
        start = loop.time()
        await self.head.move(command.target.as_axes())
        self._blind_until = loop.time()
        self.log.saccades.append((start, self._blind_until, command.reason))
        self._last_seen = self._blind_until
        self._gaze.saccade_ended(self._blind_until)

    async def _pursue(self, command: Pursue) -> None:
        self.log.limited |= command.limited
        rates = {n: each.rate for n, each in command.joints.items() if isinstance(each, Velocity)}
        angles = {
            n: self._within(n, each) for n, each in command.joints.items() if isinstance(each, Position)
        }
        await asyncio.gather(self._drive(rates), self.head.step(angles))

    def _within(self, name: str, position: Position) -> float:
        traits = self.head.traits[name]
        return min(max(position.angle, traits.low), traits.high)

    async def _drive(self, rates: Mapping[str, float]) -> None:
        """Rates; none toward a limit without a stopping margin left."""
        if rates:
            self.log.limited |= (await self.head.drive_rates(rates)).limited

    async def _pump(self) -> None:
        async for pair in paired(
            *self._cameras, bound=self._settings.pair_bound, patience=self._settings.pair_patience
        ):
            if self._listener is not None:
                self._listener.add_pair(pair)
            self._pairs.put_nowait(pair)
            self._news.set()

    def _take_fault(self, fault: Fault) -> None:
        if fault.stops_all and self._fault is None:
            self._fault = fault
            self._news.set()
