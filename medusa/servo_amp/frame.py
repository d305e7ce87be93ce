"""Frames of the amplifiers' line, without any input or output.

Command `A5 address control index offset words CRC [data CRC]`, reply `A5 FF control status1 status2 words CRC
[data CRC]`; CRC-16/XMODEM, high byte first, over header and data apart; data little-endian.
"""

from binascii import crc_hqx
from dataclasses import dataclass
from typing import Final, NamedTuple

READ: Final = 1
WRITE: Final = 2
COMPLETE: Final = 1
INCOMPLETE: Final = 2
INVALID_COMMAND: Final = 4
NO_WRITE_ACCESS: Final = 6
DATA_CRC_ERROR: Final = 8
MAX_WORDS: Final = 255

_START: Final = 0xA5
_HOST: Final = 0xFF
_HEADER: Final = 8
_DATA_FOLLOWS: Final = 0x02


@dataclass(frozen=True, slots=True)
class Command:
    """What is asked of the amplifier at an address; `words` of 16 bits are read, or `data` is written."""

    address: int
    type: int
    sequence: int
    index: int
    offset: int
    words: int
    data: bytes = b""


class Reply(NamedTuple):
    """An amplifier's reply; it does not bear an address."""

    sequence: int
    status: int
    data: bytes = b""


class RejectedBytes(NamedTuple):
    """Bytes that are no reply, and why."""

    reason: str
    frame: bytes


def encode_command(command: Command) -> bytes:
    """The bytes of a command; raises ValueError for a field out of its range."""
    kind, sequence, words, data = command.type, command.sequence, command.words, command.data
    if not (0 <= sequence <= 15 and 0 <= kind <= 3 and 0 <= words <= MAX_WORDS):
        raise ValueError(
            f"sequence {sequence} (0–15), type {kind} (0–3) or {words} words (0–255) out of range"
        )
    if kind & WRITE and len(data) != 2 * words:
        raise ValueError(f"{len(data)} bytes for {words} words")
    header = bytes((_START, command.address, sequence << 2 | kind, command.index, command.offset, words))
    frame = header + crc_hqx(header, 0).to_bytes(2, "big")
    return frame + data + crc_hqx(data, 0).to_bytes(2, "big") if data else frame


def encode_reply(reply: Reply) -> bytes:
    """The bytes of a reply, for traces."""
    follows = _DATA_FOLLOWS if reply.data else 0
    header = bytes((_START, _HOST, reply.sequence << 2 | follows, reply.status, 0, len(reply.data) // 2))
    frame = header + crc_hqx(header, 0).to_bytes(2, "big")
    return frame + reply.data + crc_hqx(reply.data, 0).to_bytes(2, "big") if reply.data else frame


class ReplyDecoder:
    """Finds replies in a stream of bytes, however it is cut."""

    def __init__(self) -> None:
        self._buffer = bytearray()

    def feed(self, data: bytes) -> list[Reply | RejectedBytes]:
        """What these bytes completed, in order."""
        self._buffer += data
        found: list[Reply | RejectedBytes] = []
        while True:
            start = self._buffer.find(_START)
            if start < 0:
                self._buffer.clear()
                return found
            del self._buffer[:start]
            if len(self._buffer) < _HEADER:
                return found
            header = bytes(self._buffer[:_HEADER])
            if header[1] != _HOST or crc_hqx(header, 0):
                # The search goes on from the second byte: an A5 inside may begin the true header.
                del self._buffer[0]
                found.append(RejectedBytes("bad header", header))
                continue
            size = 2 * header[5] if header[2] & _DATA_FOLLOWS else 0
            end = _HEADER + size + 2 if size else _HEADER
            if len(self._buffer) < end:
                return found
            block = bytes(self._buffer[_HEADER:end])
            if crc_hqx(block, 0):
                del self._buffer[:_HEADER]
                found.append(RejectedBytes("bad data CRC", header + block))
                continue
            del self._buffer[:end]
            found.append(Reply(header[2] >> 2 & 0x0F, header[3], block[:-2] if size else b""))

    def reset(self) -> None:
        """Forget an unfinished reply."""
        self._buffer.clear()
