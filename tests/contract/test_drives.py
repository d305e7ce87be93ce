"""The contract over the MC3000 on its emulator and over the ideal drive."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from medusa.config.file import parse_config
from medusa.head.faults import Cause
from medusa.ideal.config import IdealConfig, template
from medusa.ideal.drive import IdealDrive
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import PORT_NAME, simulated_head
from medusa.testing.drive_contract import DriveContract, Machine
from sim_devices.head_config import HeadConfig

NEAR_SENSORS = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}


class TestMc3000(DriveContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[Machine]:
        loop = asyncio.get_running_loop()
        async with simulated_head(seed=1, config=HeadConfig(start_deg=NEAR_SENSORS)) as sim:
            inject = sim.bench.inject
            yield Machine(
                Mc3000Drive(sim.config, sim.boards, sim.amps, port_name=PORT_NAME, seed=1),
                lambda name: sim.machine.joint_angles(loop.time())[name],
                {
                    Cause.DRIVE: lambda name: inject("head.amplifier_fault", axis=name),
                    Cause.EMERGENCY_STOP: lambda name: inject("head.emergency_stop", board=2),
                    Cause.FOLLOWING: lambda name: inject("head.encoder_loss", axis=name),
                    Cause.LIMIT: lambda name: inject(
                        "head.switch", axis=name, side="positive", held="closed"
                    ),
                    Cause.LOST: lambda name: inject("wire.unplug", line="mc3000"),
                },
            )


class TestIdeal(DriveContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[Machine]:
        config = parse_config(template(), "the template")
        assert isinstance(config, IdealConfig)
        drive = IdealDrive(config.traits)
        trip = drive.machine.trip

        def unplug(name: str) -> None:
            drive.machine.plugged = False

        yield Machine(
            drive,
            lambda name: drive.machine.angle(name, drive.now()),
            {
                Cause.DRIVE: lambda name: trip(drive.now(), [name], Cause.DRIVE),
                Cause.EMERGENCY_STOP: lambda name: trip(drive.now(), drive.traits, Cause.EMERGENCY_STOP),
                Cause.LOST: unplug,
            },
        )
