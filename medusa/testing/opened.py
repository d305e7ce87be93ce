"""How a contract opens its machine."""

from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager, asynccontextmanager

import pytest

from medusa.head.faults import Cause, Fault
from medusa.head.joint_group import JointGroup
from medusa.testing.bench import Bench, Machine


class Opened:
    """A machine that a subclass provides, opened for each test."""

    def machine(self) -> AbstractAsyncContextManager[Machine]:
        """A machine as it is after power-up, its drive not open."""
        raise NotImplementedError

    @asynccontextmanager
    async def open(self) -> AsyncIterator[Bench]:
        """An open machine, homed and enabled."""
        async with self.machine() as machine, JointGroup.open(machine.drive) as group:
            faults: list[Fault] = []
            group.subscribe(faults.append)
            await group.home()
            yield Bench(group, machine, faults)

    @pytest.fixture
    async def bench(self) -> AsyncIterator[Bench]:
        async with self.open() as bench:
            yield bench

    async def test_the_contract_is_not_empty(self) -> None:
        """A machine that stages nothing tests nothing: one joint's own fault and a lost line are the least."""
        async with self.machine() as machine:
            assert {Cause.DRIVE, Cause.LOST} <= set(machine.incidents)
