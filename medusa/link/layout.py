"""The fields of a payload in wire order, and their values in SI units."""

import struct
from dataclasses import dataclass
from math import isfinite
from typing import Any

from medusa.errors import CommandError, ProtocolError


@dataclass(frozen=True, slots=True)
class Field:
    """A little-endian field: name, struct code, and SI value of one wire unit (None: the integer itself)."""

    name: str
    code: str
    unit: float | None = None


class Layout:
    """The fields of one message's payload; `message` is what errors call it."""

    def __init__(self, message: str, *fields: Field) -> None:
        self.message = message
        self.fields = fields
        self._struct = struct.Struct("<" + "".join(field.code for field in fields))
        self._ranges = [_code_range(field.code) for field in fields]

    @property
    def size(self) -> int:
        """Bytes of the payload."""
        return self._struct.size

    def pack(self, *values: float) -> bytes:
        """Return the payload of these values (SI); raises CommandError naming field, value and range."""
        return self._struct.pack(*(self._to_wire(i, value) for i, value in enumerate(values)))

    def unpack(self, payload: bytes) -> list[Any]:
        """Return the payload's values (SI); raises ProtocolError when its length is another."""
        if len(payload) != self._struct.size:
            raise ProtocolError(
                f"{self.message} has {len(payload)} bytes, {self._struct.size} expected", frame=payload
            )
        return [
            value if field.unit is None else value * field.unit
            for field, value in zip(self.fields, self._struct.unpack(payload), strict=True)
        ]

    def _to_wire(self, index: int, value: float) -> int:
        field, (low, high) = self.fields[index], self._ranges[index]
        if field.unit is None:
            if low <= value <= high and value == int(value):
                return int(value)
            raise CommandError(f"{self.message}: {field.name} {value} is outside {low}…{high}, whole numbers")
        if isfinite(value):
            counts = round(value / field.unit)
            if low <= counts <= high:
                return counts
        span = f"{low * field.unit:.6g}…{high * field.unit:.6g}"
        raise CommandError(f"{self.message}: {field.name} {value:.6g} is outside {span} (SI units)")


def _code_range(code: str) -> tuple[int, int]:
    bits = 8 * struct.calcsize("<" + code)
    return (-(1 << (bits - 1)), (1 << (bits - 1)) - 1) if code.islower() else (0, (1 << bits) - 1)
