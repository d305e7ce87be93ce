"""What a live camera and its capture process exchange: a request on the way there, messages on the way back.

A message is a length (four bytes), that many bytes of MessagePack, and after a `FrameHeader` the image, row by row.
"""

import struct
from dataclasses import dataclass

import msgspec

from perception.camera.source import Source

LENGTH = struct.Struct("<I")


@dataclass(frozen=True)
class CaptureSettings:
    """What is asked of the camera; None leaves it as it is.

    `pixel_format` is a four-letter code such as GREY, YUYV or MJPG; `exposure` and `gain` are in the
    driver's own units and switch automatic exposure off. `delay` is the known time in seconds from the
    middle of the exposure to the driver's stamp; it is taken off every stamp.
    """

    width: int | None = None
    height: int | None = None
    rate: float | None = None
    pixel_format: str | None = None
    exposure: float | None = None
    gain: float | None = None
    delay: float = 0.0
    grey: bool = True


@dataclass(frozen=True)
class CaptureRequest:
    """What to open and how; `timeout` bounds, in seconds, how long an address may take to open or to send a frame."""

    source: Source
    settings: CaptureSettings
    name: str
    timeout: float


class Opened(msgspec.Struct, frozen=True, tag=True):
    """The camera is open, its settings taken."""


class NotOpened(msgspec.Struct, frozen=True, tag=True):
    """It is not: the name of a `CameraError` and its text."""

    error: str
    text: str


class FrameHeader(msgspec.Struct, frozen=True, tag=True):
    """A frame: its number since the opening, the middle of its exposure (s, monotonic clock), and its shape."""

    sequence: int
    stamp: float
    shape: tuple[int, ...]


Message = Opened | NotOpened | FrameHeader
_encoder = msgspec.msgpack.Encoder()
_decoder: msgspec.msgpack.Decoder[Message] = msgspec.msgpack.Decoder(Message)


def encode_message(message: Message) -> bytes:
    """The message with its length before it."""
    content = _encoder.encode(message)
    return LENGTH.pack(len(content)) + content


def decode_message(content: bytes | bytearray) -> Message:
    """The message of the bytes after the length."""
    return _decoder.decode(content)
