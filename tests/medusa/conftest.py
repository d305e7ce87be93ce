"""An emulated head in virtual time; its joints start near their home sensors, so that homing is short."""

from collections.abc import AsyncIterator

import pytest

from medusa.head.joint_group import JointGroup
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices.head_config import HeadConfig

NEAR_SENSORS = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}


@pytest.fixture
async def sim() -> AsyncIterator[SimulatedHead]:
    async with simulated_head(seed=1, config=HeadConfig(start_deg=NEAR_SENSORS)) as simulated:
        yield simulated


@pytest.fixture
async def head(sim: SimulatedHead) -> AsyncIterator[JointGroup]:
    """Homed and enabled; stopped, confirmed and disabled at the end."""
    async with sim.open() as opened:
        await opened.home()
        yield opened


@pytest.fixture
def drive(head: JointGroup) -> Mc3000Drive:
    """The head's boards and amplifiers."""
    return Mc3000Drive.of(head)
