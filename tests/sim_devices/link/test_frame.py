import json
import random
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_devices.link.frame import (
    FrameFault,
    FrameReceiver,
    Kind,
    Message,
    crc16,
    decode_cobs,
    decode_frame,
    encode_cobs,
    encode_frame,
)

VECTORS = Path(__file__).parents[2] / "vectors"
FRAMED = [
    vector for name in ("mc3000", "labmate") for vector in json.loads((VECTORS / f"{name}.json").read_text())
]
KINDS = {"request": 0, "reply": 1, "event": 2, "ack": 3, "acknowledgement": 3, "event acknowledgement": 3}

messages = st.builds(
    lambda address, kind, sequence, operation, axis, payload: (
        address,
        kind,
        sequence,
        operation,
        axis,
        payload,
    ),
    st.integers(0, 0x7E),
    st.integers(0, 3),
    st.integers(0, 63),
    st.integers(0, 255),
    st.integers(0, 255),
    st.binary(max_size=64),
)


def fields(vector):
    return (
        vector["address"],
        KINDS[vector["kind"]],
        vector["sequence"],
        vector["operation"],
        vector["axis_or_status"],
        bytes.fromhex(vector["payload"]),
    )


@pytest.mark.parametrize("vector", FRAMED, ids=lambda vector: vector["name"])
def test_every_vector_encodes_to_its_bytes(vector):
    assert encode_frame(*fields(vector)).hex() == vector["frame"]


@pytest.mark.parametrize("vector", FRAMED, ids=lambda vector: vector["name"])
def test_every_vector_decodes_to_its_fields(vector):
    (message,) = FrameReceiver().feed(bytes.fromhex(vector["frame"]))
    assert message[:6] == fields(vector)


def test_the_crc_has_the_check_value_of_its_definition():
    assert crc16(b"123456789") == 0x31C3


@pytest.mark.parametrize(
    ("plain", "stuffed"),
    [
        ("", "01"),
        ("00", "0101"),
        ("0000", "010101"),
        ("11220033", "0311220233"),
        ("11223344", "0511223344"),
        ("11000000", "0211010101"),
    ],
)
def test_stuffing_follows_the_published_examples(plain, stuffed):
    assert encode_cobs(bytes.fromhex(plain)).hex() == stuffed
    assert decode_cobs(bytes.fromhex(stuffed)) == bytes.fromhex(plain)


def test_a_run_past_the_end_is_no_stuffing():
    assert decode_cobs(b"\x05\x11\x22") is None


@given(messages)
def test_the_longest_frame_has_72_bytes_and_one_zero(message):
    frame = encode_frame(*message)
    assert len(frame) <= 72
    assert frame.index(0) == len(frame) - 1
    assert decode_frame(frame[:-1])[:6] == message


def test_a_payload_over_64_bytes_is_not_encoded():
    with pytest.raises(ValueError, match="68"):
        encode_frame(1, 0, 0, 0x10, 0, bytes(65))


@given(st.lists(messages, max_size=5), st.data())
def test_any_split_of_the_stream_decodes_alike(sent, data):
    stream = b"\0" + b"".join(encode_frame(*message) for message in sent)
    cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=12)))
    receiver = FrameReceiver()
    received = []
    for start, end in zip([0, *cuts], [*cuts, len(stream)], strict=True):
        received += receiver.feed(stream[start:end])
    assert [message[:6] for message in received] == sent


def test_bytes_one_at_a_time_decode_alike():
    frame = encode_frame(1, 0, 5, 0x10, 2, b"\0\x01\0\xff")
    receiver = FrameReceiver()
    received = [message for byte in frame for message in receiver.feed(bytes((byte,)))]
    assert [message[:6] for message in received] == [(1, 0, 5, 0x10, 2, b"\0\x01\0\xff")]


def test_an_over_long_frame_costs_no_memory_and_is_one_framing_fault():
    receiver = FrameReceiver()
    for _ in range(1000):
        assert list(receiver.feed(b"\x01" * 1000)) == []
    assert len(receiver._begun) <= 72
    good = encode_frame(1, 0, 0, 1, 15, b"ab")
    assert [type(message) for message in receiver.feed(b"\0" + good)] == [FrameFault, Message]


@pytest.mark.parametrize("length", [0, 1, 2, 3])
def test_a_message_under_four_bytes_is_a_framing_fault(length):
    short = bytes(range(1, length + 1))
    stuffed = encode_cobs(short + crc16(short).to_bytes(2, "big"))
    assert decode_frame(stuffed) is FrameFault.FRAMING


def spoilt(plain, pattern, shift, bits):
    """Flip a pattern of bits in what stood before the stuffing."""
    return (int.from_bytes(plain, "big") ^ (pattern << shift)).to_bytes(bits // 8, "big")


@pytest.mark.parametrize("vector", FRAMED[:6], ids=lambda vector: vector["name"])
def test_every_one_bit_error_is_refused(vector):
    plain = decode_cobs(bytes.fromhex(vector["frame"])[:-1])
    bits = 8 * len(plain)
    for shift in range(bits):
        assert decode_frame(encode_cobs(spoilt(plain, 1, shift, bits))) is FrameFault.CRC


def test_every_burst_up_to_16_bits_is_refused():
    # A burst of n bits begins and ends with a flipped bit; a CRC of 16 bits finds every one up to its own length.
    message = bytes.fromhex("01071300fe")
    plain = message + crc16(message).to_bytes(2, "big")
    bits = 8 * len(plain)
    number = int.from_bytes(plain, "big")
    refused = 0
    for length in range(2, 17):
        ends = 1 | 1 << (length - 1)
        for inside in range(1 << (length - 2)):
            pattern = ends | inside << 1
            # The CRC is linear: what a burst does at one place it does at each; all places for short ones.
            for shift in range(bits - length + 1) if length <= 8 else (0, 7, bits - length):
                burst = (number ^ pattern << shift).to_bytes(bits // 8, "big")
                assert crc16(burst) != 0
                refused += 1
    assert refused > 3 * 2**14


def mutate(frame, source):
    """Flip, overwrite, insert, delete, truncate or swap inside a frame, without making a new delimiter."""
    body = bytearray(frame[:-1])
    for _ in range(source.randint(1, 4)):
        place = source.randrange(len(body))
        kind = source.randrange(6)
        if kind == 0:
            body[place] = body[place] ^ 1 << source.randrange(8) or 0xFF
        elif kind == 1:
            body[place] = source.randint(1, 255)
        elif kind == 2:
            body.insert(place, source.randint(1, 255))
        elif kind == 3 and len(body) > 1:
            del body[place]
        elif kind == 4:
            del body[place + 1 :]
        else:
            other = source.randrange(len(body))
            body[place], body[other] = body[other], body[place]
    return bytes(body) + b"\0"


def test_of_100_000_mutated_frames_at_most_8_pass_and_those_are_whole():
    tried = 0
    accepted = []

    @settings(max_examples=110, derandomize=True, deadline=None, database=None)
    @given(st.integers(0, 2**32))
    def mutations(seed):
        nonlocal tried
        source = random.Random(seed)
        for n in range(1000):
            if n % 20 == 0:
                header = (source.randint(1, 0x7E), source.randrange(4), source.randrange(64))
                body = (source.randrange(256), source.randrange(16), source.randbytes(source.randrange(33)))
                frame = encode_frame(*header, *body)
            received = mutate(frame, source)
            if received == frame:
                continue
            tried += 1
            for outcome in FrameReceiver().feed(received):
                if isinstance(outcome, Message):
                    assert encode_frame(*outcome[:6]) == received
                    accepted.append((frame.hex(), received.hex()))

    mutations()
    assert tried >= 100_000
    # By chance one in 65536 passes a CRC of 16 bits; a zero put before a message passes always (initial value 0).
    assert len(accepted) <= 8


def test_kinds_are_numbered_as_on_the_page():
    assert [kind.value for kind in (Kind.REQUEST, Kind.REPLY, Kind.EVENT, Kind.ACKNOWLEDGEMENT)] == [
        0,
        1,
        2,
        3,
    ]
