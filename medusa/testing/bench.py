"""A machine under a contract: its drive, its truth from outside, what can be made to happen to it."""

import asyncio
import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import pytest

from medusa.head.drive import Drive
from medusa.head.faults import Cause, Fault
from medusa.head.joint_group import JointGroup

REST_RATE = math.radians(0.9)
"""At rest in control: one count in a sample of 2.048 ms of the finest joint; a limit cycle is under it. rad/s."""


@dataclass(frozen=True)
class Machine:
    """A drive that is not open yet, and what is known of its machine out of band.

    truth: a joint's true angle now, rad, from the zero of its raw angle or its angle. incidents: by the cause that
    has to be reported, what makes it happen to the joint given.
    """

    drive: Drive
    truth: Callable[[str], float]
    incidents: Mapping[Cause, Callable[[str], None]] = field(default_factory=dict)


@dataclass(frozen=True)
class Bench:
    """An open, homed and enabled machine with what it has reported so far."""

    group: JointGroup
    machine: Machine
    faults: list[Fault]

    @property
    def joints(self) -> tuple[str, ...]:
        """Names of the joints."""
        return tuple(self.group.traits)

    def speed(self, name: str, share: float = 0.4) -> float:
        """A rate that every test may use, a multiple of the rate step, rad/s."""
        traits = self.group.traits[name]
        return max(1, round(share * traits.speed / traits.rate_step)) * traits.rate_step

    async def true_rate(self, name: str, seconds: float = 0.01) -> float:
        """Mean true rate over the next `seconds`, rad/s."""
        before = self.machine.truth(name)
        await asyncio.sleep(seconds)
        return (self.machine.truth(name) - before) / seconds

    async def at_rest(self) -> bool:
        """No joint moves, by the truth."""
        before = {name: self.machine.truth(name) for name in self.joints}
        await asyncio.sleep(0.05)
        return all(abs(self.machine.truth(n) - before[n]) / 0.05 < REST_RATE for n in self.joints)

    async def turn(self, name: str, seconds: float = 0.2, *, direction: int = 1) -> float:
        """Turn a joint for a while, from the other side of its middle; its rate."""
        traits = self.group.traits[name]
        middle, half = (traits.low + traits.high) / 2, (traits.high - traits.low) / 2
        await self.group.move({name: middle - direction * 0.5 * half})
        rate = (await self.group.velocity({name: direction * self.speed(name)}))[name]
        await asyncio.sleep(seconds)
        return rate

    def target(self, name: str, share: float) -> float:
        """An angle at a share (−1..1) of the way from the middle to the soft limits, rad."""
        traits = self.group.traits[name]
        return (traits.low + traits.high) / 2 + share * (traits.high - traits.low) / 2

    def incident(self, cause: Cause) -> Callable[[str], None]:
        """What makes a fault of a joint happen; skips the test when the machine cannot stage it."""
        if cause not in self.machine.incidents:
            pytest.skip(f"this machine cannot stage: {cause.value}")
        return self.machine.incidents[cause]
