"""The contract of a mobile base over the Labmate on its emulator."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from labmate.simulation import simulated_base
from labmate.testing.base_contract import MobileBaseContract, Truth, World
from sim_devices.labmate import BaseConfig as EmulatedConfig

# Wheels as the base itself computes with them: what it reckons is where it is.
TRUE_WHEELS = EmulatedConfig(wheel_base=0.340, diameter_ratio=1.0)
LINE = "labmate"


class TestLabmate(MobileBaseContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[World]:
        away = [0.0]
        async with simulated_base(seed=1, emulated=TRUE_WHEELS) as sim:
            inject = sim.bench.inject

            def truth() -> Truth:
                state = sim.bench.state()["base"]
                return Truth(sim.true_pose(), state["speed"], state["turn_rate"])

            def lose_what_the_machine_sends() -> None:
                end = sim.clock() + 2.0
                inject("wire.faults", line=LINE, drop=1.0, direction="to_host", end_s=end)

            yield World(
                lambda: sim.open(suspended=lambda: away[0]),
                truth,
                {
                    "front bumper pressed": lambda: inject("base.press_bumper", side="front"),
                    "front bumper released": lambda: inject("base.release_bumper", side="front"),
                    "emergency stop pressed": lambda: inject("base.press_emergency_stop"),
                    "emergency stop released": lambda: inject("base.release_emergency_stop"),
                    "wheels held": lambda: inject("base.hold_wheels", held=True),
                    "wheels released": lambda: inject("base.hold_wheels", held=False),
                    "host not heard for 0.8 s": lambda: inject("wire.stall", line=LINE, seconds=0.8),
                    "what the machine sends is lost for 2 s": lose_what_the_machine_sends,
                    "line lost": lambda: inject("wire.unplug", line=LINE),
                    "line back": lambda: inject("wire.plug", line=LINE),
                    "restart": lambda: inject("base.restart"),
                    "host suspended for an hour": lambda: away.__setitem__(0, 3600.0),
                },
            )
