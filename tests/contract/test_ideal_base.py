"""The contract of a mobile base over the ideal one."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from labmate.base import Bumper, Cause, MobileBase
from labmate.base.events import UNTOUCHED
from labmate.testing.base_contract import MobileBaseContract, Truth, World
from labmate.testing.ideal_base import LIMITS, IdealBase
from labmate.testing.ideal_machine import IdealMachine


class TestIdealBase(MobileBaseContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[World]:
        loop = asyncio.get_running_loop()
        machine, away = IdealMachine(LIMITS), [0.0]
        drivers: list[IdealBase] = []

        @asynccontextmanager
        async def opened() -> AsyncIterator[MobileBase]:
            drivers.append(IdealBase(machine, suspended=lambda: away[0]))
            async with MobileBase(drivers[-1]) as base:
                yield base

        def truth() -> Truth:
            machine.advance(loop.time())
            return Truth(machine.pose, machine.forward.value, machine.turning.value)

        def happen(cause: Cause, touching: Bumper = UNTOUCHED) -> None:
            machine.advance(loop.time())
            machine.happen(cause, touching)

        def for_a_while(flag: str, seconds: float) -> None:
            setattr(drivers[-1], flag, True)
            loop.call_later(seconds, setattr, drivers[-1], flag, False)

        def press_emergency_stop() -> None:
            machine.button = True
            happen(Cause.EMERGENCY_STOP)

        yield World(
            opened,
            truth,
            {
                "front bumper pressed": lambda: happen(Cause.BUMPER, Bumper.FRONT),
                "front bumper released": lambda: setattr(machine, "touching", UNTOUCHED),
                "emergency stop pressed": press_emergency_stop,
                "emergency stop released": lambda: setattr(machine, "button", False),
                "wheels held": lambda: happen(Cause.STALLED),
                "wheels released": lambda: None,
                "host not heard for 0.8 s": lambda: for_a_while("deaf", 0.8),
                "what the machine sends is lost for 2 s": lambda: for_a_while("mute", 2.0),
                "line lost": lambda: drivers[-1].unplug(),
                "line back": lambda: setattr(drivers[-1], "plugged", True),
                "restart": lambda: machine.restart(),
                "host suspended for an hour": lambda: away.__setitem__(0, 3600.0),
            },
        )
