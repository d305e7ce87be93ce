"""The mark that keeps "homed" across processes: four bytes that only a homed axis of this machine carries."""

import hashlib
from os.path import abspath

import msgspec

from medusa.mc3000.board.registers import MARK_LENGTH
from medusa.mc3000.config import AxisConfig

NO_MARK = bytes(MARK_LENGTH)


def name_of_port(path: str) -> str:
    """The same name for a port however its path was typed."""
    return abspath(path)


def axis_digest(name: str, config: AxisConfig) -> str:
    """SHA-256 of a joint's whole configuration, hexadecimal: it changes with any of its keys."""
    return hashlib.sha256(msgspec.json.encode((name, config))).hexdigest()


def make_mark(port: str, name: str, config: AxisConfig, boot_count: int) -> bytes:
    """The mark for registers 18H–1BH: a hash of port, configuration and boot count, never four zeros.

    Whatever makes the count invalid (power-up, reset, PRESET, a write to the position) clears the registers, and a
    restart changes the boot count, so an old mark is never taken for a new one.
    """
    identity = f"{port}\0{axis_digest(name, config)}\0{boot_count}".encode()
    mark = hashlib.sha256(identity).digest()[:MARK_LENGTH]
    return mark if mark != NO_MARK else b"\x01" + mark[1:]
