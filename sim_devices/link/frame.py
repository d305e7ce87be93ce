"""Frames of the link, device side: COBS(message ‖ CRC-16/XMODEM) 00 (docs/protocols, the serial link)."""

import binascii
from collections.abc import Iterator
from enum import IntEnum
from functools import lru_cache
from typing import NamedTuple

LONGEST_MESSAGE = 68
LONGEST_FRAME = 72
_CODES = [bytes((length + 1,)) for length in range(254)]
_HEADER = 4
_CRC = 2


class Kind(IntEnum):
    """Bits 7–6 of a message's second byte."""

    REQUEST = 0
    REPLY = 1
    EVENT = 2
    ACKNOWLEDGEMENT = 3


class Message(NamedTuple):
    """A message and its bytes; `axis` is the status in a reply."""

    address: int
    kind: int
    sequence: int
    operation: int
    axis: int
    payload: bytes
    raw: bytes


class FrameFault(IntEnum):
    """Why a frame was dropped."""

    FRAMING = 0
    CRC = 1


def crc16(data: bytes) -> int:
    """Return CRC-16/XMODEM: polynomial 1021H, initial value 0, nothing reflected; "123456789" gives 31C3H."""
    return binascii.crc_hqx(data, 0)


def encode_cobs(data: bytes) -> bytes:
    """Stuff at most 253 bytes: every run up to a zero is led by its length + 1, and no zero remains."""
    if len(data) > 253:
        raise ValueError(f"{len(data)} bytes, at most 253 fit one COBS run")
    return b"".join([_CODES[len(run)] + run for run in data.split(b"\0")])


def decode_cobs(data: bytes) -> bytes | None:
    """Undo `encode_cobs`; None when a run goes past the end."""
    runs = []
    start, end = 0, len(data)
    while start < end:
        after = start + data[start]
        if after > end or after == start:
            return None
        runs.append(data[start + 1 : after])
        start = after
    return b"\0".join(runs)


def encode_frame(
    address: int, kind: int, sequence: int, operation: int, axis: int, payload: bytes = b""
) -> bytes:
    """Return the bytes on the wire, the closing 00 included."""
    message = bytes((address, kind << 6 | sequence, operation, axis)) + payload
    if len(message) > LONGEST_MESSAGE:
        raise ValueError(f"message of {len(message)} bytes, at most {LONGEST_MESSAGE}")
    return encode_cobs(message + crc16(message).to_bytes(2, "big")) + b"\0"


# Every device of a line decodes the same frame.
@lru_cache(maxsize=16)
def decode_frame(frame: bytes) -> Message | FrameFault:
    """Decode what stood before a 00 (not empty)."""
    if len(frame) >= LONGEST_FRAME:
        return FrameFault.FRAMING
    data = decode_cobs(frame)
    if data is None or len(data) < _HEADER + _CRC:
        return FrameFault.FRAMING
    # The CRC of a message with its own CRC behind it is 0.
    if binascii.crc_hqx(data, 0) != 0:
        return FrameFault.CRC
    raw = data[:-_CRC]
    return Message(raw[0], raw[1] >> 6, raw[1] & 0x3F, raw[2], raw[3], raw[_HEADER:], raw)


class FrameReceiver:
    """Cuts a stream of bytes into frames: any split of the stream gives the same messages."""

    def __init__(self) -> None:
        self._begun = b""

    def reset(self) -> None:
        """Forget a frame that has begun."""
        self._begun = b""

    def feed(self, data: bytes) -> Iterator[Message | FrameFault]:
        """Yield what each 00 completes; empty frames are ignored, over-long ones cost no memory."""
        *complete, rest = (self._begun + data).split(b"\0")
        # One byte more than fits is enough to know that the frame is too long.
        self._begun = rest[:LONGEST_FRAME]
        for frame in complete:
            if frame:
                yield decode_frame(frame)
