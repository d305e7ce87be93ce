"""An emulated base in virtual time, and its driver."""

from collections.abc import AsyncIterator

import pytest

from labmate.base.mobile_base import MobileBase
from labmate.simulation import SimulatedBase, simulated_base


@pytest.fixture
async def sim() -> AsyncIterator[SimulatedBase]:
    async with simulated_base(seed=1) as simulated:
        yield simulated


@pytest.fixture
async def base(sim: SimulatedBase) -> AsyncIterator[MobileBase]:
    async with sim.open() as opened:
        yield opened
