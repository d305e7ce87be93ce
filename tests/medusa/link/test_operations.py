"""The shared operations, row by row against the table of docs/protocols.md, and what a row refuses."""

import pytest

from medusa.errors import CommandError
from medusa.link.layout import Field, Layout
from medusa.link.messages import OPERATIONS
from medusa.link.operation import Operation
from tests import protocol_page


def test_every_operation_of_the_page_has_its_row_with_the_pages_fields() -> None:
    rows = protocol_page.operations(section=1)
    assert {code: row[0] for code, row in rows.items()} == {c: op.name for c, op in OPERATIONS.items()}
    for code, (_, request, reply) in rows.items():
        assert protocol_page.written(OPERATIONS[code].request) == request
        # HELLO's reply ends with the device's own part.
        if code != 0x01:
            assert protocol_page.written(OPERATIONS[code].reply) == reply


def test_what_a_shared_operation_does_is_what_the_page_says() -> None:
    # "STOP, MODE 0, EMERGENCY_STOP, CLEAR and HELLO first withdraw every open request that can move something";
    # "STOP and EMERGENCY_STOP wait for no place in the window"; PING and STATISTICS ask and change nothing.
    does = {op.name: (op.reads, op.moves, op.stops, op.urgent) for op in OPERATIONS.values()}
    assert does == {
        "HELLO": (False, False, True, False),
        "PING": (True, False, False, False),
        "STATISTICS": (True, False, False, False),
        "WATCHDOG": (False, False, False, False),
        "EMERGENCY_STOP": (False, False, True, True),
        "CLEAR": (False, False, True, False),
        "EVENT_MASK": (False, False, False, False),
    }


@pytest.mark.parametrize(
    "does", [{"reads": True, "moves": True}, {"moves": True, "stops": True}, {"reads": True, "urgent": True}]
)
def test_an_operation_does_one_thing(does: dict[str, bool]) -> None:
    with pytest.raises(ValueError, match="reads, acts, moves or stops"):
        Operation(0x40, "BOTH", **does)


@pytest.mark.parametrize(
    ("value", "told"),
    [(65536, "65536 is outside 0…65535"), (float("nan"), "timeout_ms nan"), (0.5, "0.5 is")],
)
def test_a_value_that_its_field_cannot_hold_is_refused_with_name_and_range(value: float, told: str) -> None:
    with pytest.raises(CommandError, match=told):
        Layout("WATCHDOG", Field("timeout_ms", "H")).pack(value)
