"""The amplifiers' frames against the vectors, and in pieces, with garbage and gaps (docs/protocols)."""

import json
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sim_devices.servo_amp.frame import CommandReceiver, crc16, encode_reply

VECTORS = json.loads((Path(__file__).parents[2] / "vectors" / "servo_amp.json").read_text())
COMMANDS = [vector for vector in VECTORS if "address" in vector]
REPLIES = {vector["name"]: bytes.fromhex(vector["frame"]) for vector in VECTORS if "address" not in vector}
BYTE_S = 10 / 115200


def make_receiver():
    return CommandReceiver(gap_s=0.010, byte_s=BYTE_S)


def as_vector(command):
    return {
        "address": command.address,
        "type": command.kind,
        "sequence": command.sequence,
        "index": command.index,
        "offset": command.offset,
        "words": command.words,
        "data": command.data.hex(),
    }


def fields(vector):
    return {key: value for key, value in vector.items() if key not in ("name", "frame")}


def test_the_crc_is_xmodem():
    assert crc16(b"123456789") == 0x31C3


@pytest.mark.parametrize("vector", COMMANDS, ids=lambda vector: vector["name"])
def test_every_command_vector_is_understood(vector):
    (command,) = make_receiver().feed(bytes.fromhex(vector["frame"]), 1.0)
    assert as_vector(command) == fields(vector)


@pytest.mark.parametrize(
    ("name", "sequence", "status", "data"),
    [
        ("reply: write acknowledged, sequence 1", 1, 1, b""),
        ("reply: position 123456, sequence 4", 4, 1, (123456).to_bytes(4, "little")),
        ("reply: invalid command, sequence 0", 0, 4, b""),
        ("reply: no write access, sequence 2", 2, 6, b""),
    ],
)
def test_every_reply_vector_is_made(name, sequence, status, data):
    assert encode_reply(sequence, status, data) == REPLIES[name]


def test_every_vector_is_used():
    assert len(COMMANDS) + len(REPLIES) == len(VECTORS) == 12


def all_frames():
    return b"".join(bytes.fromhex(vector["frame"]) for vector in COMMANDS)


@settings(max_examples=60, deadline=None)
@given(st.lists(st.integers(1, 30), max_size=60))
def test_any_split_is_understood_alike(sizes):
    data, receiver, commands, t = all_frames(), make_receiver(), [], 1.0
    for size in [*sizes, len(data)]:
        piece, data = data[:size], data[size:]
        if piece:
            t += len(piece) * BYTE_S
            commands += receiver.feed(piece, t)
    assert [as_vector(command) for command in commands] == [fields(vector) for vector in COMMANDS]


@settings(max_examples=60, deadline=None)
@given(st.binary(max_size=12).filter(lambda garbage: b"\xa5" not in garbage))
def test_garbage_before_a_frame_is_passed_over(garbage):
    commands = make_receiver().feed(garbage + all_frames(), 1.0)
    assert len(commands) == len(COMMANDS)


def test_after_a_bad_header_the_search_goes_on_from_its_second_byte():
    frame = bytes.fromhex(COMMANDS[0]["frame"])
    # A start byte right before a good frame makes a bad header out of its first seven bytes.
    for stray in (b"\xa5", b"\xa5\xa5\xa5", frame[:5]):
        assert len(make_receiver().feed(stray + frame, 1.0)) == 1


@pytest.mark.parametrize("byte", range(8))
def test_a_flipped_bit_in_the_header_is_met_with_silence(byte):
    frame = bytearray.fromhex(COMMANDS[6]["frame"])
    frame[byte] ^= 0x04
    assert make_receiver().feed(bytes(frame), 1.0) == []


def test_a_bad_crc_of_the_data_is_told_apart():
    frame = bytearray.fromhex(COMMANDS[1]["frame"])
    frame[-1] ^= 1
    (command,) = make_receiver().feed(bytes(frame), 1.0)
    assert command.data is None


@pytest.mark.parametrize(("gap", "understood"), [(0.0099, 1), (0.0101, 0)])
def test_a_gap_of_10_ms_inside_a_frame_drops_it(gap, understood):
    frame = bytes.fromhex(COMMANDS[1]["frame"])
    receiver = make_receiver()
    receiver.feed(frame[:5], 1.0)
    rest = frame[5:]
    assert len(receiver.feed(rest, 1.0 + gap + len(rest) * BYTE_S)) == understood


def test_after_the_gap_the_next_frame_is_understood():
    frame = bytes.fromhex(COMMANDS[1]["frame"])
    receiver = make_receiver()
    receiver.feed(frame[:9], 1.0)
    assert len(receiver.feed(frame, 1.1)) == 1
