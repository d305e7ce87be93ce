"""The contract over the MC3000 on its emulator and over the ideal drive."""

import asyncio
import math
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from medusa.head.drive import JointTraits
from medusa.head.faults import Cause
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import PORT_NAME, simulated_head
from medusa.testing.drive_contract import DriveContract, Machine
from medusa.testing.ideal_drive import IdealDrive
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


def traits(reach_deg: float, speed_deg_s: float, acceleration_deg_s2: float) -> JointTraits:
    reach, speed, acceleration = (math.radians(x) for x in (reach_deg, speed_deg_s, acceleration_deg_s2))
    return JointTraits(
        low=-reach,
        high=reach,
        speed=speed,
        acceleration=acceleration,
        resolution=1e-5,
        rate_step=1e-6,
        settle=1e-4,
        largest_step=math.inf,
        park=0.0,
    )


IDEAL_TRAITS = {
    "pan": traits(93.0, 180.0, 1080.0),
    "tilt": traits(38.0, 111.6, 540.0),
    "left_vergence": traits(38.0, 180.0, 1080.0),
    "right_vergence": traits(38.0, 180.0, 1080.0),
}


class TestIdeal(DriveContract):
    @asynccontextmanager
    async def machine(self) -> AsyncIterator[Machine]:
        drive = IdealDrive(IDEAL_TRAITS)
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
