"""The base's messages against the byte vectors and the protocol page."""

import json
from math import degrees, inf, nan, radians
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from labmate.driver import messages as m
from medusa.errors import CommandError, ProtocolError
from medusa.link.frame import Message, decode_body, encode_frame
from tests import protocol_page

VECTORS = json.loads((Path(__file__).parents[2] / "vectors/labmate.json").read_text())
KINDS = {"request": 0, "reply": 1, "event": 2}
MESSAGES: dict[str, m.Message | None] = {
    "HELLO reply": m.HelloPart(0.34, 50000),
    "DRIVE 80 mm/s, -7.1 deg/s, 500 ms": m.Drive(0.08, radians(-7.1), 0.5),
    "POSE reply": m.PoseReply(5_000_000, 1.5, -0.02, radians(45.0), 0.08, 0.0),
    "TURN -90 deg": m.Turn(radians(-90.0)),
    "STATUS reply, driving, 24.6 V": m.StatusReply(m.Mode.DRIVE, m.Flags.MOVING | m.Flags.MOTOR_POWER, 24.6),
    "event: front bumper": m.BaseEvent(6_000_000, 1.5, -0.02, radians(45.0), m.Bumper.FRONT),
    "LIMITS": m.SetLimits(0.3, radians(15.0), 0.25, radians(30.0)),
    "TURN refused: front bumper pressed": None,
    "event: motion done, stopped by a bumper": m.BaseEvent(
        6_500_000, 1.501, -0.0201, radians(45.0), m.Ending.BUMPER
    ),
}


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: v["name"])
def test_every_vector_encodes_and_decodes(vector: dict[str, object]) -> None:
    message = MESSAGES[str(vector["name"])]
    frame = bytes.fromhex(str(vector["frame"]))
    head = (vector["address"], KINDS[str(vector["kind"])], vector["sequence"], vector["operation"])
    decoded = decode_body(frame[:-1])
    assert isinstance(decoded, Message)
    assert decoded[:5] == (*head, vector["axis_or_status"])
    # HELLO's first eight bytes belong to the link, the rest to the base.
    common = decoded.payload[:8] if vector["name"] == "HELLO reply" else b""
    if message is None:
        assert decoded.payload == b""
        return
    assert encode_frame(decoded._replace(payload=common + message.encode())) == frame
    found = type(message).decode(decoded.payload[len(common) :])
    assert found.encode() == message.encode()
    for field in message.LAYOUT.fields:
        # A wire unit is at least 1e-4; what is left is the rounding of one product.
        expected = float(getattr(message, field.name))
        assert float(getattr(found, field.name)) == pytest.approx(expected, rel=1e-12, abs=1e-13)


def test_no_vector_is_left_out() -> None:
    assert {v["name"] for v in VECTORS} == set(MESSAGES)


def test_every_operation_of_the_page_has_its_row_with_the_pages_fields() -> None:
    assert protocol_page.operations(section=6) == {
        op.code: (op.name, protocol_page.written(op.request), protocol_page.written(op.reply))
        for op in m.OPERATIONS
    }


def test_what_an_operation_does_is_what_the_page_says() -> None:
    # DRIVE, GO and TURN move; STOP is always accepted and waits for no place in the window; POSE, STATUS and
    # ENCODERS ask and change nothing; SET_POSE and LIMITS set something and move nothing.
    assert {op.name for op in m.OPERATIONS if op.moves} == {"DRIVE", "GO", "TURN"}
    assert {op.name for op in m.OPERATIONS if op.reads} == {"POSE", "STATUS", "ENCODERS"}
    assert {op.name for op in m.OPERATIONS if op.stops and op.urgent} == {"STOP"}
    assert {op.name for op in m.OPERATIONS if op.stops} == {"STOP"}


def test_the_mask_lets_every_event_of_the_page_through() -> None:
    # Events 43, 44, 50–53: bits 3, 4, 10H–13H of the mask.
    assert m.EVENT_MASK == 0x000F_0018
    assert sorted(m.EVENT_NAMES) == [0x43, 0x44, 0x50, 0x51, 0x52, 0x53]


@pytest.mark.parametrize(
    ("bit", "flag"),
    list(
        enumerate(
            [
                m.Flags.MOVING,
                m.Flags.FRONT_BUMPER,
                m.Flags.REAR_BUMPER,
                m.Flags.LEFT_BUMPER,
                m.Flags.RIGHT_BUMPER,
                m.Flags.EMERGENCY_STOP,
                m.Flags.MOTOR_POWER,
                m.Flags.BATTERY_LOW,
                m.Flags.STALLED,
            ]
        )
    ),
)
def test_each_flag_is_the_bit_of_the_page(bit: int, flag: m.Flags) -> None:
    payload = bytes([0]) + (1 << bit).to_bytes(2, "little") + (24000).to_bytes(2, "little")
    assert m.StatusReply.decode(payload).flags == flag


@pytest.mark.parametrize("mode", list(m.Mode))
def test_each_mode_decodes_and_only_idle_without_motion_is_rest(mode: m.Mode) -> None:
    status = m.StatusReply.decode(bytes([mode, 0x40, 0, 0xC0, 0x5D]))
    assert status.mode is mode
    assert status.battery == pytest.approx(24.0)
    assert status.at_rest is (mode is m.Mode.IDLE)
    assert not m.StatusReply.decode(bytes([mode, 0x41, 0, 0xC0, 0x5D])).at_rest


def test_a_mode_that_the_page_does_not_know_is_a_protocol_error() -> None:
    with pytest.raises(ProtocolError, match="mode 5"):
        m.StatusReply.decode(bytes([5, 0, 0, 0, 0]))


@pytest.mark.parametrize(
    ("message", "told"),
    [
        (m.Drive(3.3, 0.0, 0.3), "speed 3.3 is outside -3.2768…3.2767"),
        (m.Drive(0.0, radians(328.0), 0.3), "turn_rate"),
        (m.Drive(0.0, 0.0, 70.0), "valid"),
        (m.Go(nan), "distance nan"),
        (m.Turn(-inf), "angle -inf"),
        (m.SetLimits(-0.1, 0.1, 0.1, 0.1), "speed -0.1 is outside 0…6.5535"),
        (m.SetPose(3e5, 0.0, 0.0), "x 300000"),
    ],
)
def test_what_does_not_fit_the_wire_is_refused_with_value_and_range(message: m.Message, told: str) -> None:
    with pytest.raises(CommandError, match=told.replace(".", r"\.")):
        message.encode()


@pytest.mark.parametrize(
    "kind", [m.PoseReply, m.StatusReply, m.EncodersReply, m.BaseEvent, m.HelloPart, m.SetLimits, m.Go]
)
def test_a_payload_of_another_length_is_a_protocol_error(kind: type[m.Message]) -> None:
    with pytest.raises(ProtocolError, match="2 bytes"):
        kind.decode(b"\0\0")


@given(st.integers(-(2**31), 2**31 - 1))
def test_every_wire_angle_survives_radians(counts: int) -> None:
    payload = counts.to_bytes(4, "little", signed=True)
    assert m.Turn.decode(payload).encode() == payload
    assert degrees(m.Turn.decode(payload).angle) == pytest.approx(counts / 100.0, rel=1e-12)


@given(st.binary(min_size=20, max_size=20))
def test_every_pose_reply_survives_si_units(payload: bytes) -> None:
    assert m.PoseReply.decode(payload).encode() == payload
