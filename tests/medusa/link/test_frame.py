"""The codec against the byte vectors of the protocol pages, and against damage."""

import itertools
import json
import random
from pathlib import Path

import pytest
from cobs import cobs
from hypothesis import given, settings
from hypothesis import strategies as st

from medusa.link.frame import KIND_NAMES, Decoder, Message, Rejected, decode_body, encode_frame

VECTORS = [
    vector
    for name in ("mc3000", "labmate")
    for vector in json.loads((Path(__file__).parents[2] / "vectors" / f"{name}.json").read_text())
]
KINDS = {"request": 0, "reply": 1, "event": 2, "acknowledgement": 3, "ack": 3}

messages = st.builds(
    Message,
    address=st.integers(0, 0x7E),
    kind=st.integers(0, 3),
    sequence=st.integers(0, 63),
    operation=st.integers(0, 255),
    axis=st.integers(0, 255),
    payload=st.binary(max_size=64),
)


def message_of(vector: dict[str, object]) -> Message:
    return Message(
        address=int(str(vector["address"])),
        kind=KINDS[str(vector["kind"])],
        sequence=int(str(vector["sequence"])),
        operation=int(str(vector["operation"])),
        axis=int(str(vector["axis_or_status"])),
        payload=bytes.fromhex(str(vector["payload"])),
    )


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: str(v["name"]))
def test_every_vector_of_the_pages_is_encoded_and_decoded(vector: dict[str, object]) -> None:
    frame = bytes.fromhex(str(vector["frame"]))
    assert encode_frame(message_of(vector)) == frame
    assert Decoder().feed(frame) == [message_of(vector)]


def test_the_crc_is_xmodem() -> None:
    # link.md: "123456789" has the CRC 31C3H, high byte first.
    assert cobs.decode(encode_frame(Message(0x31, 0, 0x32, 0x33, 0x34, b"56789"))[:-1])[-2:] == bytes.fromhex(
        "31c3"
    )


@given(st.lists(messages, max_size=6), st.lists(st.integers(0, 400), max_size=12))
@settings(max_examples=150, deadline=None, derandomize=True)
def test_any_split_of_a_stream_decodes_alike(sent: list[Message], cuts: list[int]) -> None:
    stream = b"\x11\x22\0" + b"".join(map(encode_frame, sent)) + b"\x07" * 100 + b"\0"
    whole, split = Decoder(), Decoder()
    expected = whole.feed(stream)
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    got = [item for a, b in itertools.pairwise(edges) for item in split.feed(stream[a:b])]
    assert got == expected
    assert [item for item in got if isinstance(item, Message)] == sent
    assert (split.frames, split.crc_errors, split.framing_errors) == (
        whole.frames,
        whole.crc_errors,
        whole.framing_errors,
    )


def test_a_byte_at_a_time_decodes_alike() -> None:
    stream = b"".join(bytes.fromhex(str(v["frame"])) for v in VECTORS)
    decoder = Decoder()
    got = [item for i in range(len(stream)) for item in decoder.feed(stream[i : i + 1])]
    assert got == [message_of(v) for v in VECTORS]


def test_empty_frames_are_ignored_and_not_counted() -> None:
    decoder = Decoder()
    assert decoder.feed(b"\0\0\0\0") == []
    assert decoder.framing_errors == 0


@pytest.mark.parametrize(
    ("stream", "reason"),
    [
        (b"\x05\x01\0", "bad COBS"),
        (cobs.encode(b"\x01\x02\x03\x66\x66") + b"\0", "too short"),
        (b"\x01" * 72 + b"\0", "too long"),
        (b"\xff" * 5000 + b"\0", "too long"),
        (encode_frame(Message(1, 0, 0, 2, 15)).replace(b"\x02", b"\x03", 1), "bad COBS"),
        (bytes.fromhex("020107010fefbe59bd00"), "bad CRC"),
    ],
)
def test_what_is_no_frame_is_dropped_counted_and_the_next_one_read(stream: bytes, reason: str) -> None:
    good = Message(1, 1, 5, 2, 0, b"\x01\x02\x03\x04")
    decoder = Decoder()
    first, second = decoder.feed(stream + encode_frame(good))
    assert isinstance(first, Rejected)
    assert first.reason == reason
    assert second == good
    assert decoder.crc_errors + decoder.framing_errors == 1
    assert decoder.crc_errors == (reason == "bad CRC")


def test_a_stream_without_a_zero_costs_no_memory() -> None:
    decoder = Decoder()
    for _ in range(100):
        decoder.feed(b"\x55" * 4096)
    assert len(decoder._tail) == 72


def test_the_longest_message_is_68_bytes_and_72_on_the_wire() -> None:
    message = Message(1, 0, 0, 0x11, 0, b"\x01" * 64)
    assert len(encode_frame(message)) == 72
    assert Decoder().feed(encode_frame(message)) == [message]
    with pytest.raises(ValueError, match="65 bytes, at most 64"):
        encode_frame(message._replace(payload=b"\x01" * 65))


@pytest.mark.parametrize("changes", [{"kind": 4}, {"sequence": 64}, {"address": 256}, {"operation": -1}])
def test_a_field_out_of_range_is_refused(changes: dict[str, int]) -> None:
    with pytest.raises(ValueError):
        encode_frame(Message(1, 0, 0, 2, 15)._replace(**changes))


def damaged(body: int, pattern: int, shift: int, size: int) -> Message | Rejected:
    """Decode a message ‖ CRC with a pattern of bits flipped before stuffing."""
    return decode_body(cobs.encode((body ^ pattern << shift).to_bytes(size, "big")))


@pytest.mark.parametrize("vector", VECTORS, ids=lambda v: str(v["name"]))
def test_every_one_bit_error_before_stuffing_is_refused(vector: dict[str, object]) -> None:
    raw = cobs.decode(bytes.fromhex(str(vector["frame"]))[:-1])
    body, bits = int.from_bytes(raw, "big"), 8 * len(raw)
    assert all(damaged(body, 1, shift, len(raw)) == refused(raw, 1, shift) for shift in range(bits))


def refused(raw: bytes, pattern: int, shift: int) -> Rejected:
    wrong = (int.from_bytes(raw, "big") ^ pattern << shift).to_bytes(len(raw), "big")
    return Rejected("bad CRC", cobs.encode(wrong))


def test_every_burst_of_up_to_16_bits_before_stuffing_is_refused() -> None:
    # The shortest message, so that every burst at every place can be tried: a burst begins and ends with a
    # wrong bit, what is between is anything.
    raw = cobs.decode(encode_frame(Message(1, 0, 1, 2, 15))[:-1])
    body, size = int.from_bytes(raw, "big"), len(raw)
    bursts = 0
    for length in range(2, 17):
        for between in range(1 << (length - 2)):
            pattern = 1 << (length - 1) | between << 1 | 1
            for shift in range(8 * size - length + 1):
                if type(damaged(body, pattern, shift, size)) is not Rejected:
                    pytest.fail(f"pattern {pattern:#x} at bit {shift} passed")
                bursts += 1
    # Of each length L ≤ 16 there are 2^(L−2) patterns at 48 − L + 1 places.
    assert bursts == sum(2 ** (length - 2) * (49 - length) for length in range(2, 17))


@pytest.mark.parametrize("vector", VECTORS[::4], ids=lambda v: str(v["name"]))
def test_bursts_in_the_messages_of_the_pages_are_refused(vector: dict[str, object]) -> None:
    raw = cobs.decode(bytes.fromhex(str(vector["frame"]))[:-1])
    body, size = int.from_bytes(raw, "big"), len(raw)
    rng = random.Random(16)
    for _ in range(2000):
        length = rng.randint(2, 16)
        pattern = 1 << (length - 1) | rng.getrandbits(length) & ~1 & (1 << (length - 1)) - 1 | 1
        assert type(damaged(body, pattern, rng.randint(0, 8 * size - length), size)) is Rejected


def mutate(frame: bytes, rng: random.Random) -> bytes:
    """Change a frame's inside: bytes replaced, lost, put in, moved; never only a 00 at an end."""
    data = bytearray(frame[:-1])
    for _ in range(rng.choice((1, 1, 2, 3, 8))):
        at = rng.randrange(len(data))
        match rng.randrange(5):
            case 0:
                data[at] ^= 1 << rng.randrange(8)
            case 1:
                data[at] = rng.randrange(256)
            case 2 if len(data) > 1:
                del data[at]
            case 3:
                data.insert(at, rng.randrange(1, 256))
            case _:
                other = rng.randrange(len(data))
                data[at], data[other] = data[other], data[at]
    return bytes(data) + b"\0"


def test_a_hundred_thousand_mutated_frames_pass_no_more_than_chance_allows() -> None:
    # A CRC of 16 bits passes one wrong frame in 65536: 1.5 are expected here, more than 8 with p < 1e-4.
    rng = random.Random(1994)
    frames = [bytes.fromhex(str(vector["frame"])) for vector in VECTORS]
    accepted = tried = 0
    decoder = Decoder()
    while tried < 100_000:
        frame = rng.choice(frames)
        wrong = mutate(frame, rng)
        # Not mutated at all, or only cut at its end: the frame itself is in it unharmed.
        if frame[:-1] in wrong:
            continue
        tried += 1
        for item in decoder.feed(wrong):
            if isinstance(item, Message):
                accepted += 1
                assert encode_frame(item)[:-1] in wrong.split(b"\0")
    assert accepted <= 8


@given(st.binary(max_size=300))
@settings(max_examples=300, deadline=None, derandomize=True)
def test_garbage_never_raises_and_whatever_passes_encodes_to_the_same_bytes(garbage: bytes) -> None:
    runs = garbage.split(b"\0")
    for item in Decoder().feed(garbage):
        if isinstance(item, Message):
            assert encode_frame(item)[:-1] in runs
        else:
            assert item.reason in ("bad COBS", "bad CRC", "too short", "too long")


def test_kinds_have_names() -> None:
    assert [KIND_NAMES[kind] for kind in range(4)] == ["request", "reply", "event", "ack"]
