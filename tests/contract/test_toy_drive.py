"""A third drive, in the length that a machine's author writes: two servos behind a queue of set points.

Its machine knows goals and torque, nothing else: no events, no watchdog, no memory of an emergency stop.
"""

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Collection, Mapping
from contextlib import asynccontextmanager

from medusa.errors import CommandError, PortError
from medusa.head.drive import Capabilities, JointState, JointTraits, MovePlan
from medusa.head.faults import Cause
from medusa.head.polled_drive import PolledDrive
from medusa.head.trapezoid import Motion, profile, ramp
from medusa.testing.drive_contract import DriveContract, Machine

REACH, SPEED, ACCELERATION = math.radians(60), math.radians(120), math.radians(600)
TRAITS = JointTraits(-REACH, REACH, SPEED, ACCELERATION, 1e-4, 1e-4, 1e-3, 0.2, 0.0)


class Servo:
    """A servo: where it is going, whether its torque is on, whether it is too hot."""

    def __init__(self) -> None:
        self.motion, self.rate, self.torque, self.hot = Motion(0.0, 0.1), 0.0, False, False

    def go(self, now: float, motion: Callable[[float, float, float], Motion], rate: float = 0.0) -> None:
        self.motion, self.rate = motion(now, *self.motion.at(now)), rate


class ToyDrive(PolledDrive):
    """Pan and tilt on two servos."""

    def __init__(self) -> None:
        super().__init__("the servo bus")
        self.traits = {"pan": TRAITS, "tilt": TRAITS}
        self.units = (("pan", "tilt"),)
        self.can = Capabilities(0.002, 0.004, 0.001, 0.2, None, False, True, "absolute", "limp", "host")
        self.servos = {name: Servo() for name in self.traits}
        self.plugged = True

    async def _bus(self) -> float:
        """One exchange on the bus; the moment in which it acts."""
        await asyncio.sleep(0.0005)
        if not self.plugged:
            raise PortError("toy", "unplugged")
        return asyncio.get_running_loop().time()

    async def open(self) -> None:
        await self.stop(self.traits)

    async def _power(self, names: Collection[str], on: bool) -> None:
        await self.exchange(self._bus)
        for name in names:
            self.servos[name].torque = on

    async def _read(self) -> dict[str, JointState]:
        now = await self.exchange(self._bus)
        return {name: self._state(servo, now) for name, servo in self.servos.items()}

    def _state(self, servo: Servo, now: float) -> JointState:
        position, rate = servo.motion.at(now)
        moving = bool(rate or servo.rate) or now < servo.motion.end
        hot = frozenset({Cause.DRIVE} if servo.hot else ())
        return JointState(now, position, position, position, servo.rate, moving, servo.torque, True, hot)

    async def _go(self, plan: MovePlan) -> None:
        now = await self.exchange(self._bus, moves=True)
        for name, target in plan.finals.items():
            speed, acceleration = plan.device[name]
            self._torqued(name).go(
                now,
                lambda t, x, v, goal=target, s=speed, a=acceleration: profile(t, x, v, goal, s, a),  # type: ignore[misc]
            )

    def _torqued(self, name: str) -> Servo:
        if not self.servos[name].torque:
            raise CommandError(f"{name}: is idle; enable it first")
        return self.servos[name]

    async def set_rates(self, rates: Mapping[str, float]) -> dict[str, float]:
        now = await self.exchange(self._bus, moves=True)
        for name, rate in rates.items():
            self._torqued(name).go(now, lambda t, x, v, r=rate: ramp(t, x, v, r, ACCELERATION), rate)  # type: ignore[misc]
        return dict(rates)

    async def step(self, angles: Mapping[str, float]) -> None:
        now = await self.exchange(self._bus, moves=True)
        for name, angle in angles.items():
            self._torqued(name).go(
                now, lambda t, x, v, goal=angle: profile(t, x, v, goal, SPEED, ACCELERATION)
            )  # type: ignore[misc]

    async def stop(self, names: Collection[str]) -> None:
        now = await self.exchange(self._bus)
        for name in names:
            self.servos[name].go(now, lambda t, x, v: ramp(t, x, v, 0.0, ACCELERATION))

    async def emergency_stop(self) -> None:
        self.latch(Cause.EMERGENCY_STOP)
        now = await self.exchange(self._bus)
        for servo in self.servos.values():
            servo.torque = False
            servo.go(now, lambda t, x, v: Motion(t, x))

    async def clear(self) -> None:
        self.unlatch()


class TestToy(DriveContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[Machine]:
        drive = ToyDrive()
        loop = asyncio.get_running_loop()

        def overheat(name: str) -> None:
            drive.servos[name].hot, drive.servos[name].torque = True, False
            drive.servos[name].go(loop.time(), lambda t, x, v: Motion(t, x))

        def unplug(name: str) -> None:
            # The servos of this bus hold where they are when nobody speaks to them.
            drive.plugged = False
            for servo in drive.servos.values():
                servo.go(loop.time(), lambda t, x, v: ramp(t, x, v, 0.0, ACCELERATION))

        yield Machine(
            drive,
            lambda name: drive.servos[name].motion.at(loop.time())[0],
            {Cause.DRIVE: overheat, Cause.LOST: unplug},
        )
