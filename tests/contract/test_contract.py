"""The contract itself: what gives it nothing does not pass it."""

import inspect
from collections.abc import Callable

import pytest

from labmate.testing.base_contract import INCIDENTS, MobileBaseContract, World

TESTS = {
    name: test
    for name, test in inspect.getmembers(MobileBaseContract, inspect.isfunction)
    if name.startswith("test_")
}


class Empty(MobileBaseContract):
    lacks = INCIDENTS


@pytest.mark.parametrize("test", TESTS.values(), ids=TESTS)
def test_no_test_of_a_mobile_base_runs_without_a_machine(test: Callable[..., object]) -> None:
    assert {"world", "base"} & set(inspect.signature(test).parameters)


async def test_a_base_that_gives_no_machine_fails() -> None:
    assert len(TESTS) > 30
    with pytest.raises(NotImplementedError):
        async with Empty().machine():
            pass


async def test_a_base_to_which_nothing_can_happen_fails(world: World) -> None:
    with pytest.raises(AssertionError):
        await Empty().test_every_incident_is_there_or_named_as_lacking(world)


@pytest.fixture
def world() -> World:
    return World(lambda: pytest.fail("not opened"), lambda: pytest.fail("not looked at"), {})
