"""Every vector of the board's page both ways, and the edges of the codec."""

import json
from pathlib import Path
from typing import Any

import pytest

from medusa.errors import ProtocolError
from medusa.mc3000.board import messages
from medusa.mc3000.board.messages import (
    LAYOUTS,
    AxisSnapshot,
    BoardEvent,
    Operation,
    Snapshot,
    decode_event,
    decode_read,
    decode_reply,
    decode_request,
    decode_snapshot,
    decode_write,
    encode_event,
    encode_read,
    encode_reply,
    encode_request,
    encode_snapshot,
    encode_write,
)
from medusa.mc3000.board.registers import Flags, Inputs, Mode, Status

VECTORS = json.loads((Path(__file__).parents[3] / "vectors" / "mc3000.json").read_text())


def vectors(kind: str) -> list[Any]:
    chosen = [v for v in VECTORS if v["kind"] == kind and v.get("fields")]
    return [pytest.param(v, id=v["name"]) for v in chosen]


@pytest.mark.parametrize("vector", vectors("request"))
def test_a_request_of_the_page_decodes_and_encodes(vector: dict[str, Any]) -> None:
    operation, payload, fields = (
        Operation(vector["operation"]),
        bytes.fromhex(vector["payload"]),
        vector["fields"],
    )
    if operation is Operation.READ:
        assert decode_read(payload) == (fields["register"], fields["count"])
        assert encode_read(fields["register"], fields["count"]) == payload
    elif operation is Operation.WRITE:
        assert decode_write(payload) == (fields["register"], bytes(fields["values"]))
        assert encode_write(fields["register"], bytes(fields["values"])) == payload
    else:
        assert decode_request(operation, payload) == fields
        assert encode_request(operation, **fields) == payload


@pytest.mark.parametrize("vector", vectors("reply"))
def test_a_reply_of_the_page_decodes_and_encodes(vector: dict[str, Any]) -> None:
    operation, payload, fields = (
        Operation(vector["operation"]),
        bytes.fromhex(vector["payload"]),
        vector["fields"],
    )
    if operation is Operation.SNAPSHOT:
        expected = Snapshot(
            fields["time_us"],
            tuple(
                AxisSnapshot(actual, command, Status(status), Flags(flags), dac - 128, Inputs(inputs))
                for actual, command, status, flags, dac, inputs in fields["axes"]
            ),
        )
        assert decode_snapshot(payload) == expected
        assert encode_snapshot(expected) == payload
    else:
        assert decode_reply(operation, payload) == fields
        assert encode_reply(operation, **fields) == payload


@pytest.mark.parametrize("vector", vectors("event"))
def test_an_event_of_the_page_decodes_and_encodes(vector: dict[str, Any]) -> None:
    fields, payload = vector["fields"], bytes.fromhex(vector["payload"])
    axis = vector["axis_or_status"]
    event = decode_event(vector["operation"], axis, payload)
    assert event == BoardEvent(
        Operation(vector["operation"]),
        None if axis == 0x0F else axis,
        fields["time_us"],
        fields["position"],
        fields["detail"],
    )
    assert encode_event(event) == payload


def test_every_payload_without_fields_belongs_to_an_operation_without_fields() -> None:
    for vector in VECTORS:
        operation = vector["operation"]
        if vector["kind"] == "request" and not vector.get("fields") and not vector["payload"]:
            assert decode_request(Operation(operation), b"") == {}


@pytest.mark.parametrize("operation", [op for op in LAYOUTS if LAYOUTS[op].reply])
def test_a_reply_of_another_length_is_a_protocol_error(operation: Operation) -> None:
    with pytest.raises(ProtocolError, match=f"{operation.name} carries"):
        decode_reply(operation, bytes(60))


def test_a_field_that_does_not_fit_is_refused_by_name() -> None:
    with pytest.raises(ValueError, match="A=256"):
        encode_request(Operation.FILTER, A=256, B=0, K=0, T=255)
    with pytest.raises(ValueError, match="VELOCITY: velocity=32768"):
        encode_request(Operation.VELOCITY, velocity=32768)
    with pytest.raises(ValueError, match="takes final, start"):
        encode_request(Operation.MOVE, final=3)


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
