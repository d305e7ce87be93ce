"""Frames of the amplifiers' line, from the amplifiers' side.

Command `A5 address control index offset words CRC [data CRC]`, reply `A5 FF control status1 status2 words CRC
[data CRC]`; CRC-16/XMODEM, high byte first, over the six header bytes and over the data.
"""

from dataclasses import dataclass

START = 0xA5
REPLY_ADDRESS = 0xFF
READ, WRITE = 1, 2
HEADER_BYTES = 8


def crc16(data: bytes | bytearray) -> int:
    """CRC-16/XMODEM: polynomial 1021H, from 0, not reflected; "123456789" gives 31C3H."""
    crc = 0
    for byte in data:
        crc = (crc << 8 & 0xFF00) ^ _TABLE[crc >> 8 ^ byte]
    return crc


def _table_entry(byte: int) -> int:
    crc = byte << 8
    for _ in range(8):
        crc = (crc << 1 ^ (0x1021 if crc & 0x8000 else 0)) & 0xFFFF
    return crc


_TABLE = tuple(_table_entry(byte) for byte in range(256))


@dataclass(frozen=True)
class Command:
    """A command whose header was good; `data` is None when its CRC was bad, empty when it carries none."""

    address: int
    kind: int
    sequence: int
    index: int
    offset: int
    words: int
    data: bytes | None


def encode_reply(sequence: int, status: int, data: bytes = b"") -> bytes:
    """Return a reply with its data, if any."""
    control = sequence << 2 | (2 if data else 0)
    header = bytes([START, REPLY_ADDRESS, control, status, 0, len(data) // 2])
    frame = header + crc16(header).to_bytes(2, "big")
    return frame + data + crc16(data).to_bytes(2, "big") if data else frame


class CommandReceiver:
    """Finds commands in a stream of bytes: `feed(data, t)`.

    After a bad header the search for A5 goes on from its second byte; a gap over `gap_s` drops what was begun.
    """

    def __init__(self, gap_s: float, byte_s: float) -> None:
        self._gap_s = gap_s
        self._byte_s = byte_s
        self._buffer = bytearray()
        self._last = 0.0

    def feed(self, data: bytes, t: float) -> list[Command]:
        """Take bytes of which the last has arrived at t; return the commands that they complete."""
        first = t - len(data) * self._byte_s
        if first - self._last > self._gap_s:
            self._buffer.clear()
        self._last = t
        self._buffer += data
        commands: list[Command] = []
        while (size := self._find()) is not None:
            commands.append(self._decode(bytes(self._buffer[:size])))
            del self._buffer[:size]
        return commands

    def _find(self) -> int | None:
        """Bring the next good header to the front; return the length of its frame if it is whole."""
        buffer = self._buffer
        while True:
            start = buffer.find(START)
            del buffer[: start if start >= 0 else len(buffer)]
            if len(buffer) < HEADER_BYTES:
                return None
            if crc16(buffer[:6]) == int.from_bytes(buffer[6:8], "big"):
                carries = buffer[2] & WRITE and buffer[5]
                size = HEADER_BYTES + (2 * buffer[5] + 2 if carries else 0)
                return size if len(buffer) >= size else None
            del buffer[0]

    def _decode(self, frame: bytes) -> Command:
        _, address, control, index, offset, words = frame[:6]
        data: bytes | None = frame[HEADER_BYTES:-2]
        if len(frame) > HEADER_BYTES and crc16(data or b"") != int.from_bytes(frame[-2:], "big"):
            data = None
        return Command(address, control & 3, control >> 2 & 0x0F, index, offset, words, data)
