"""The registry of bases."""

from typing import get_args

from labmate.config import Machine
from labmate.machines import MACHINES


def test_what_a_configuration_may_name_has_a_row() -> None:
    assert set(MACHINES) == set(get_args(Machine))
