"""The amplifiers' frames against the vectors, and in pieces, with garbage and gaps (docs/protocols)."""

import json
import random
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


@pytest.mark.parametrize("vector", COMMANDS, ids=lambda vector: vector["name"])
def test_a_flipped_bit_in_the_header_is_met_with_silence(vector):
    header = bytes.fromhex(vector["frame"])[:8]
    for bit in range(64):
        wrong = (int.from_bytes(header, "big") ^ 1 << bit).to_bytes(8, "big")
        assert make_receiver().feed(wrong, 1.0) == [], bit


def test_a_flipped_bit_in_the_data_is_told_apart():
    frame = bytes.fromhex(COMMANDS[1]["frame"])
    size = len(frame) - 8
    for bit in range(8 * size):
        wrong = (int.from_bytes(frame, "big") ^ 1 << bit).to_bytes(len(frame), "big")
        (command,) = make_receiver().feed(wrong, 1.0)
        assert command.data is None, bit


def mutate(frame, source):
    """Overwrite, insert, delete or swap bytes of a frame."""
    body = bytearray(frame)
    for _ in range(source.randint(1, 4)):
        place = source.randrange(len(body))
        match source.randrange(4):
            case 0:
                body[place] ^= 1 << source.randrange(8)
            case 1:
                body.insert(place, source.randrange(256))
            case 2 if len(body) > 1:
                del body[place]
            case _:
                other = source.randrange(len(body))
                body[place], body[other] = body[other], body[place]
    return bytes(body)


def test_of_100_000_mutated_commands_at_most_8_pass():
    # 16 bits of CRC pass one wrong header in 65536: 1.5 are expected, more than 8 with p < 1e-4.
    source = random.Random(1994)
    frames = [bytes.fromhex(vector["frame"]) for vector in COMMANDS]
    accepted = tried = 0
    while tried < 100_000:
        frame = source.choice(frames)
        wrong = mutate(frame, source)
        if frame[:8] in wrong:
            continue
        tried += 1
        for command in make_receiver().feed(wrong, 1.0):
            accepted += 1
            control = command.kind | command.sequence << 2
            header = bytes([0xA5, command.address, control, command.index, command.offset, command.words])
            assert header + crc16(header).to_bytes(2, "big") in wrong
    assert accepted <= 8


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
