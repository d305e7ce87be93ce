"""The board's replies and events against the vectors of its page, and the edges of the codec."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from medusa.errors import ProtocolError
from medusa.mc3000.board import (
    AxisSnapshot,
    BoardEvent,
    EventKind,
    Flags,
    Inputs,
    Latched,
    LatchSource,
    Mode,
    Settings,
    Snapshot,
    Status,
    messages,
)
from medusa.mc3000.board.messages import decode_event

VECTORS = json.loads((Path(__file__).parents[3] / "vectors" / "mc3000.json").read_text())


def vectors(kind: str) -> list[Any]:
    chosen = [v for v in VECTORS if v["kind"] == kind and v.get("fields")]
    return [pytest.param(v, id=v["name"]) for v in chosen]


def snapshot(fields: dict[str, Any]) -> Snapshot:
    axes = [
        AxisSnapshot(actual, command, Status(status), Flags(flags), dac - 128, Inputs(inputs))
        for actual, command, status, flags, dac, inputs in fields["axes"]
    ]
    return Snapshot(fields["time_us"], tuple(axes))


DECODED: dict[int, tuple[Callable[[bytes], object], Callable[[dict[str, Any]], object]]] = {
    0x12: (messages.decode_position, lambda f: f["actual"]),
    0x14: (messages.decode_snapshot, snapshot),
    0x1C: (messages.decode_inputs, lambda f: Inputs(f["inputs"])),
    0x21: (
        messages.decode_latched,
        lambda f: Latched(LatchSource(f["source"]), bool(f["caught"]), f["position"], f["time_us"]),
    ),
    0x22: (
        messages.decode_settings,
        lambda f: Settings(Mode(f["mode"]), f["following_limit"], bool(f["limit_enable"]), bool(f["armed"])),
    ),
}
"""Decoder of each reply of the board's own, and what it makes of the vector's fields."""


@pytest.mark.parametrize("vector", [v for v in vectors("reply") if v.values[0]["operation"] >= 0x10])
def test_a_reply_of_the_page_decodes(vector: dict[str, Any]) -> None:
    decode, expected = DECODED[vector["operation"]]
    assert decode(bytes.fromhex(vector["payload"])) == expected(vector["fields"])


def test_the_boards_part_of_hello_carries_axes_and_clock() -> None:
    (hello,) = (v for v in VECTORS if v["name"] == "HELLO reply")
    # The first eight bytes belong to the link.
    part = bytes.fromhex(hello["payload"])[8:]
    assert messages.decode_board_part(part) == (hello["fields"]["axes"], hello["fields"]["clock_hz"])


@pytest.mark.parametrize("vector", vectors("event"))
def test_an_event_of_the_page_decodes(vector: dict[str, Any]) -> None:
    fields, axis = vector["fields"], vector["axis_or_status"]
    assert decode_event(vector["operation"], axis, bytes.fromhex(vector["payload"])) == BoardEvent(
        EventKind(vector["operation"]),
        None if axis == 0x0F else axis,
        fields["time_us"],
        fields["position"],
        fields["detail"],
    )


@pytest.mark.parametrize("operation", sorted(DECODED))
def test_a_reply_of_another_length_is_a_protocol_error(operation: int) -> None:
    with pytest.raises(ProtocolError, match=r"has 60 bytes, \d+ expected"):
        DECODED[operation][0](bytes(60))


def test_a_mode_or_a_source_that_the_page_does_not_know_is_a_protocol_error() -> None:
    with pytest.raises(ProtocolError, match="no Mode 4"):
        messages.decode_settings(bytes([4, 0, 0, 1, 0]))
    with pytest.raises(ProtocolError, match="no LatchSource 9"):
        messages.decode_latched(bytes([9]) + bytes(9))


def test_the_event_mask_lets_the_eight_events_of_the_page_through() -> None:
    # 40, 41, 42, 43, 44, 46, 47 and 48H: bits 0–4 and 6–8.
    assert messages.EVENT_MASK_ALL == 0b1_1101_1111


def test_an_unknown_event_is_a_protocol_error() -> None:
    with pytest.raises(ProtocolError, match="45H"):
        decode_event(0x45, 0, bytes(9))
    with pytest.raises(ProtocolError, match="8 bytes"):
        decode_event(0x40, 0, bytes(8))


@pytest.mark.parametrize(
    ("flags", "mode"),
    [
        (0b000010, Mode.IDLE),
        (0b001010, Mode.IDLE),
        (0b001000, Mode.PROPORTIONAL_VELOCITY),
        (0b100000, Mode.INTEGRAL_VELOCITY),
        (0b000001, Mode.POSITION),
        (0, Mode.POSITION),
    ],
)
def test_the_flags_show_the_mode(flags: int, mode: Mode) -> None:
    assert AxisSnapshot(0, 0, Status(0), Flags(flags), 0, Inputs(0)).mode is mode
