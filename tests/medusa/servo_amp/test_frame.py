"""The amplifiers' codec against the byte vectors of the protocol page, and against damage."""

import itertools
import json
import random
from binascii import crc_hqx
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from medusa.servo_amp.frame import Command, RejectedBytes, Reply, ReplyDecoder, encode_command, encode_reply

VECTORS = json.loads((Path(__file__).parents[2] / "vectors" / "servo_amp.json").read_text())
COMMANDS = [vector for vector in VECTORS if "address" in vector]
# The page's replies, by their names: what each carries.
REPLIES = {
    "reply: write acknowledged, sequence 1": Reply(1, 1),
    "reply: position 123456, sequence 4": Reply(4, 1, (123456).to_bytes(4, "little")),
    "reply: invalid command, sequence 0": Reply(0, 4),
    "reply: no write access, sequence 2": Reply(2, 6),
}
FRAMES = {vector["name"]: bytes.fromhex(vector["frame"]) for vector in VECTORS if vector["name"] in REPLIES}

replies = st.builds(
    Reply,
    sequence=st.integers(0, 15),
    status=st.sampled_from([1, 2, 4, 6, 8]),
    data=st.binary(max_size=32).map(lambda data: data[: len(data) // 2 * 2]),
)


def test_every_vector_of_the_page_is_a_command_or_a_reply_tried_here() -> None:
    assert len(COMMANDS) + len(FRAMES) == len(VECTORS)


@pytest.mark.parametrize("vector", COMMANDS, ids=lambda v: v["name"])
def test_every_command_of_the_page_is_encoded(vector: dict[str, object]) -> None:
    command = Command(
        *(int(str(vector[key])) for key in ("address", "type", "sequence", "index", "offset", "words")),
        bytes.fromhex(str(vector["data"])),
    )
    assert encode_command(command).hex() == vector["frame"]


@pytest.mark.parametrize("name", REPLIES)
def test_every_reply_of_the_page_is_decoded_and_encoded(name: str) -> None:
    assert ReplyDecoder().feed(FRAMES[name]) == [REPLIES[name]]
    assert encode_reply(REPLIES[name]) == FRAMES[name]


@given(st.lists(replies, max_size=5), st.lists(st.integers(0, 200), max_size=10))
@settings(max_examples=150, deadline=None, derandomize=True)
def test_any_split_of_a_stream_decodes_alike(sent: list[Reply], cuts: list[int]) -> None:
    stream = b"\x17\x00" + b"".join(map(encode_reply, sent))
    edges = [0, *sorted(min(cut, len(stream)) for cut in cuts), len(stream)]
    decoder = ReplyDecoder()
    got = [item for a, b in itertools.pairwise(edges) for item in decoder.feed(stream[a:b])]
    assert got == ReplyDecoder().feed(stream)
    assert [item for item in got if isinstance(item, Reply)] == sent


@pytest.mark.parametrize("name", REPLIES)
def test_every_one_bit_error_is_refused(name: str) -> None:
    frame = int.from_bytes(FRAMES[name], "big")
    size = len(FRAMES[name])
    for bit in range(8 * size):
        wrong = (frame ^ 1 << bit).to_bytes(size, "big")
        assert not any(isinstance(item, Reply) for item in ReplyDecoder().feed(wrong)), bit


def bursts(lengths: range) -> Iterator[int]:
    """Every pattern of these lengths that begins and ends with a wrong bit."""
    for length in lengths:
        for between in range(1 << (length - 2)):
            yield 1 << (length - 1) | between << 1 | 1


def test_no_burst_of_up_to_16_bits_leaves_the_crc_of_a_header_as_it_is() -> None:
    # A CRC is linear: header and CRC pass damaged exactly when the damage alone has the CRC 0.
    for pattern in bursts(range(2, 17)):
        for shift in range(64 - pattern.bit_length() + 1):
            if crc_hqx((pattern << shift).to_bytes(8, "big"), 0) == 0:
                pytest.fail(f"pattern {pattern:#x} at bit {shift} passes")


def test_bursts_in_a_reply_are_refused() -> None:
    frame = int.from_bytes(FRAMES["reply: position 123456, sequence 4"], "big")
    size = len(FRAMES["reply: position 123456, sequence 4"])
    for pattern in bursts(range(2, 14)):
        shift = pattern * 7919 % (8 * size - pattern.bit_length() + 1)
        wrong = (frame ^ pattern << shift).to_bytes(size, "big")
        assert not any(isinstance(item, Reply) for item in ReplyDecoder().feed(wrong)), (pattern, shift)


def test_after_a_bad_header_the_search_goes_on_from_its_second_byte() -> None:
    # A5 opens a false header that reaches into the true one.
    decoder = ReplyDecoder()
    got = decoder.feed(b"\xa5\xff\x04" + FRAMES["reply: write acknowledged, sequence 1"])
    assert [item for item in got if isinstance(item, Reply)] == [Reply(1, 1)]


def test_a_bad_data_crc_drops_the_data_and_the_next_reply_is_read() -> None:
    frame = bytearray(FRAMES["reply: position 123456, sequence 4"])
    frame[9] ^= 0x10
    got = ReplyDecoder().feed(bytes(frame) + FRAMES["reply: write acknowledged, sequence 1"])
    assert [item.reason for item in got if isinstance(item, RejectedBytes)] == ["bad data CRC"]
    assert [item for item in got if isinstance(item, Reply)] == [Reply(1, 1)]


def test_a_hundred_thousand_mutated_replies_pass_no_more_than_chance_allows() -> None:
    # 16 bits of CRC pass one wrong frame in 65536: 1.5 are expected, more than 8 with p < 1e-4.
    rng = random.Random(1994)
    frames = list(FRAMES.values())
    accepted = 0
    for _ in range(100_000):
        frame = rng.choice(frames)
        wrong = bytearray(frame)
        for _ in range(rng.choice((1, 1, 2, 3))):
            at = rng.randrange(len(wrong))
            if rng.random() < 0.7:
                wrong[at] ^= rng.randrange(1, 256)
            else:
                del wrong[at]
        if bytes(wrong) == frame:
            continue
        for item in ReplyDecoder().feed(bytes(wrong)):
            if isinstance(item, Reply):
                accepted += 1
                assert encode_reply(item) in bytes(wrong)
    assert accepted <= 8


def test_garbage_costs_no_memory() -> None:
    decoder = ReplyDecoder()
    rng = random.Random(5)
    for _ in range(50):
        decoder.feed(rng.randbytes(4096))
    # A false header with a good CRC may wait for at most 255 words and their CRC.
    assert len(decoder._buffer) <= 8 + 2 * 255 + 2


@pytest.mark.parametrize("change", [{"sequence": 16}, {"words": 256}, {"type": 4}, {"words": 2}])
def test_a_field_out_of_range_is_refused(change: dict[str, int]) -> None:
    fields: dict[str, int] = {"address": 1, "type": 2, "sequence": 0, "index": 1, "offset": 0, "words": 1}
    with pytest.raises(ValueError):
        encode_command(Command(**(fields | change), data=b"\0\0"))
