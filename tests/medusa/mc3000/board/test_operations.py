"""The table of operations against the board's page and its vectors: fields, axis, and what each one does."""

import json
from pathlib import Path
from typing import Any

import pytest

from medusa.errors import CommandError
from medusa.link import Operation
from medusa.link.messages import OPERATIONS as SHARED
from medusa.mc3000.board import Mode
from medusa.mc3000.board import operations as op
from tests import protocol_page

VECTORS = json.loads((Path(__file__).parents[3] / "vectors" / "mc3000.json").read_text())
REQUESTS = [
    pytest.param(v, id=v["name"])
    for v in VECTORS
    # A payload without fields is there for its framing.
    if v["kind"] == "request" and (v.get("fields") or not v["payload"])
]
ROWS = {row.code: row for row in (*SHARED.values(), *op.OPERATIONS)}


def test_every_operation_of_the_page_has_its_row_with_the_pages_fields() -> None:
    page = protocol_page.operations(section=3)
    assert {row.code for row in op.OPERATIONS} == set(page)
    for row in op.OPERATIONS:
        fields = protocol_page.written(row.request), protocol_page.written(row.reply)
        assert (row.name, *fields) == page[row.code]


def test_every_operation_is_for_the_axes_of_the_page() -> None:
    page = protocol_page.axes(section=3)
    assert all(row.axis == page[row.code] for row in op.OPERATIONS)


def does(row: Operation) -> str:
    flags = {"reads": row.reads, "moves": row.moves, "stops": row.stops, "urgent": row.urgent}
    return " ".join(word for word, holds in flags.items() if holds) or "acts"


def test_what_an_operation_does_is_what_the_page_says() -> None:
    # "STOP, MODE 0, EMERGENCY_STOP, CLEAR and HELLO first withdraw every open request that can move something",
    # "STOP and EMERGENCY_STOP wait for no place in the window"; what a running profile, a latched limit or an
    # emergency stop refuses is what can move an axis; requests without a field and with a reply ask.
    assert {row.name: does(row) for row in op.OPERATIONS if row.name not in ("WRITE", "MODE")} == {
        "READ": "reads",
        "POSITION": "reads",
        "COMMAND": "moves",
        "SNAPSHOT": "reads",
        "FILTER": "acts",
        "VELOCITY": "moves",
        "PROFILE": "acts",
        "MOVE": "moves",
        "START": "moves",
        "PRESET": "acts",
        "INPUTS": "reads",
        "LATCH": "acts",
        "LIMIT_ENABLE": "acts",
        "FOLLOWING": "acts",
        "STOP": "stops urgent",
        "LATCHED": "reads",
        "SETTINGS": "reads",
    }


def test_mode_0_stops_and_every_control_mode_moves() -> None:
    assert {mode.value: does(op.mode_of(mode)) for mode in Mode} == {
        0: "stops",
        1: "moves",
        2: "moves",
        3: "moves",
    }


def test_a_write_moves_where_the_page_gives_its_register_the_meaning_of_a_motion() -> None:
    # 0C–0EH COMMAND; 23, 24, 3CH VELOCITY; 00H MOVE and MODE; 05H MODE; 08, 09H a motor command.
    motion = {0x00, 0x05, 0x08, 0x09, 0x0C, 0x0D, 0x0E, 0x23, 0x24, 0x3C}
    for register in range(0x40):
        assert does(op.write_of(register, b"\x03")) == ("moves" if register in motion else "acts")


@pytest.mark.parametrize(
    ("register", "values", "expected"),
    [
        (0x05, b"\x00", "stops"),
        (0x05, b"\x01", "stops"),
        (0x05, b"\x03", "moves"),
        # Two registers: 06H is none, and the board refuses it; whatever it might do, a stop takes it back.
        (0x05, b"\x01\x00", "moves"),
        # 20–22H are the filter's; the fourth byte goes to 23H, a velocity.
        (0x20, b"\x01\x02\x03", "acts"),
        (0x20, b"\x01\x02\x03\x04", "moves"),
        # A mark in 18–1BH.
        (0x18, b"mark", "acts"),
    ],
)
def test_what_a_write_does_follows_from_what_it_carries(register: int, values: bytes, expected: str) -> None:
    assert does(op.write_of(register, values)) == expected


@pytest.mark.parametrize("vector", REQUESTS)
def test_every_request_among_the_vectors_is_what_its_row_packs(vector: dict[str, Any]) -> None:
    row, fields = ROWS[vector["operation"]], dict(vector.get("fields", {}))
    values = bytes(fields.pop("values", []))
    assert set(fields) == {field.name for field in row.request.fields}
    packed = row.request.pack(*(fields[field.name] for field in row.request.fields))
    assert (packed + values).hex() == vector["payload"]
    assert row.axis == "either" or (vector["axis_or_status"] == 0x0F) is (row.axis == "whole")


@pytest.mark.parametrize(
    "vector",
    [
        pytest.param(v, id=v["name"])
        for v in VECTORS
        if v["kind"] == "reply" and v["axis_or_status"] == 0 and ROWS[v["operation"]].reply_size is not None
    ],
)
def test_every_reply_among_the_vectors_has_the_size_of_its_row(vector: dict[str, Any]) -> None:
    assert len(bytes.fromhex(vector["payload"])) == ROWS[vector["operation"]].reply_size


def test_a_field_that_does_not_fit_is_refused_by_name() -> None:
    with pytest.raises(CommandError, match="FILTER: A 256 is outside 0…255"):
        op.FILTER.request.pack(256, 0, 0, 255)
    with pytest.raises(CommandError, match="VELOCITY: velocity 32768 is outside -32768…32767"):
        op.VELOCITY.request.pack(32768)
