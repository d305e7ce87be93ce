"""How a contract opens its machine."""

import contextlib
from collections.abc import AsyncIterator
from contextlib import AbstractAsyncContextManager

import pytest

from labmate.base import MobileBase
from labmate.testing.world import INCIDENTS, World
from medusa.errors import MedusaError


class OpenedBase:
    """A machine that a subclass gives, opened for each test; `lacks` names the incidents that it cannot have."""

    lacks: frozenset[str] = frozenset()

    def machine(self) -> AbstractAsyncContextManager[World]:
        """Start the machine, at rest, with nobody connected."""
        raise NotImplementedError("a base gives its machine")

    @pytest.fixture
    async def world(self) -> AsyncIterator[World]:
        async with self.machine() as world:
            yield world

    @pytest.fixture
    async def base(self, world: World) -> AsyncIterator[MobileBase]:
        opened = world.open()
        base = await opened.__aenter__()
        yield base
        # What a test has broken on purpose may keep the stop from being confirmed.
        with contextlib.suppress(MedusaError):
            await opened.__aexit__(None, None, None)

    async def test_every_incident_is_there_or_named_as_lacking(self, world: World) -> None:
        assert set(world.incidents) == INCIDENTS - self.lacks
        # One that lacked everything would be held to nothing.
        assert len(self.lacks) < len(INCIDENTS) / 2
