"""Frames of the serial link: COBS(message ‖ CRC) 00, without any input or output.

A `Decoder` takes the stream in pieces of any size and returns what it completed: a `Message` for a good frame,
a `Rejected` for one that has to be dropped. How the stream was cut makes no difference.
"""

from binascii import crc_hqx
from typing import Final, NamedTuple

from cobs import cobs

REQUEST: Final = 0
REPLY: Final = 1
EVENT: Final = 2
ACKNOWLEDGEMENT: Final = 3

KIND_NAMES: Final = ("request", "reply", "event", "ack")
MAX_PAYLOAD: Final = 64
_new_tuple = tuple.__new__
_MIN_MESSAGE: Final = 4
_CRC_BYTES: Final = 2
# 68 bytes of message and the CRC, which COBS makes one byte longer; the 00 is not part of it.
_MAX_ENCODED: Final = 71


class Message(NamedTuple):
    """One message; in a reply `axis` holds the status, in an acknowledgement 0."""

    address: int
    kind: int
    sequence: int
    operation: int
    axis: int
    payload: bytes = b""


class Rejected(NamedTuple):
    """A run of bytes that is no frame, and why; at most 72 of its bytes are kept."""

    reason: str
    frame: bytes


def encode_frame(message: Message) -> bytes:
    """Return the bytes of a message on the wire, its 00 included.

    CRC-16/XMODEM over the message, high byte first. Raises ValueError for a field out of its range.
    """
    address, kind, sequence, operation, axis, payload = message
    if len(payload) > MAX_PAYLOAD:
        raise ValueError(f"payload of {len(payload)} bytes, at most {MAX_PAYLOAD} fit in a message")
    if not (0 <= kind <= 3 and 0 <= sequence <= 63):
        raise ValueError(f"kind {kind} (0–3) or sequence number {sequence} (0–63) out of range")
    body = bytes((address, kind << 6 | sequence, operation, axis)) + payload
    encoded: bytes = cobs.encode(body + crc_hqx(body, 0).to_bytes(2, "big"))
    return encoded + b"\0"


def encode_request(address: int, number: int, operation: int, axis: int, payload: bytes) -> bytes:
    """Return the bytes of a request whose fields are known to be in range."""
    body = bytes((address, number, operation, axis)) + payload
    encoded: bytes = cobs.encode(body + crc_hqx(body, 0).to_bytes(2, "big"))
    return encoded + b"\0"


def decode_body(encoded: bytes) -> Message | Rejected:
    """Return the message between two 00, or why there is none."""
    if len(encoded) > _MAX_ENCODED:
        return Rejected("too long", encoded[: _MAX_ENCODED + 1])
    try:
        body = cobs.decode(encoded)
    except cobs.DecodeError:
        return Rejected("bad COBS", encoded)
    if len(body) < _MIN_MESSAGE + _CRC_BYTES:
        return Rejected("too short", encoded)
    if crc_hqx(body, 0):
        return Rejected("bad CRC", encoded)
    head = body[1]
    # Message(…) without its Python-level __new__, which would cost as much as COBS and CRC together.
    return _new_tuple(Message, (body[0], head >> 6, head & 0x3F, body[2], body[3], body[4:-2]))


class Decoder:
    """Finds the frames in a stream of bytes; counts what it dropped."""

    def __init__(self) -> None:
        self._tail = b""
        self.frames = 0
        self.crc_errors = 0
        self.framing_errors = 0

    def feed(self, data: bytes) -> list[Message | Rejected]:
        """Return what these bytes completed, in order."""
        if not self._tail and data.find(b"\0") == len(data) - 1 and data:
            # The usual case: one whole frame.
            item = decode_body(data[:-1])
            if type(item) is Message:
                self.frames += 1
                return [item]
        *bodies, tail = (self._tail + data).split(b"\0")
        # A run without 00 is already too long after 72 bytes: what follows of it need not be kept.
        self._tail = tail[: _MAX_ENCODED + 1]
        found: list[Message | Rejected] = []
        for encoded in bodies:
            if not encoded:
                continue
            item = decode_body(encoded)
            if type(item) is Message:
                self.frames += 1
            elif item[0] == "bad CRC":
                self.crc_errors += 1
            else:
                self.framing_errors += 1
            found.append(item)
        return found

    def reset(self) -> None:
        """Forget an unfinished frame: the stream begins anew."""
        self._tail = b""
