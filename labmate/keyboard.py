"""Driving by keys: which command the keyboard gives now, and when it has gone silent. Pure.

A terminal reports that a key went down, never that it came up. A key that is held repeats: first after up to
0.66 s, then some thirty times a second. So the first stroke is believed for 0.7 s and every repeat for 0.25 s.
"""

from __future__ import annotations

from dataclasses import dataclass

FIRST_HOLD = 0.7
REPEAT_HOLD = 0.25
SCALES = (0.1, 0.2, 0.35, 0.5, 0.75, 1.0)

_SEQUENCES = {b"\x1b[A": "w", b"\x1b[B": "s", b"\x1b[D": "a", b"\x1b[C": "d"}
_SEQUENCES |= {b"\x1bO" + sequence[-1:]: key for sequence, key in list(_SEQUENCES.items())}
_MOVES = {
    "w": (1.0, 0.0),
    "s": (-1.0, 0.0),
    "a": (0.0, 1.0),
    "d": (0.0, -1.0),
    "u": (1.0, 1.0),
    "o": (1.0, -1.0),
}

HELP = "w/↑ ahead   s/↓ back   a/← left   d/→ right   u o curves   + - speed   space stop   ! e-stop   c clear   q quit"


def split_keys(data: bytes) -> list[str]:
    """Keys in what a terminal sent at once; arrows become w, a, s, d, everything not understood a space (stop)."""
    keys: list[str] = []
    while data:
        arrow = _SEQUENCES.get(data[:3])
        if arrow is not None:
            keys.append(arrow)
            data = data[3:]
        elif data[0] == 0x1B:
            keys.append(" ")
            break
        else:
            keys.append(chr(data[0]) if 0x20 <= data[0] < 0x7F else " ")
            data = data[1:]
    return keys


@dataclass
class Keys:
    """The keyboard's state; times are the caller's, s."""

    scale_index: int = 2
    _key: str | None = None
    _until: float = 0.0

    @property
    def scale(self) -> float:
        """Share of the limits at which the keys drive."""
        return SCALES[self.scale_index]

    def press(self, key: str, now: float) -> None:
        """Take a key that drives, changes the speed or (any other) stops."""
        if key in _MOVES:
            repeated = key == self._key and now < self._until
            self._until = now + (REPEAT_HOLD if repeated else FIRST_HOLD)
            self._key = key
        elif key == "+":
            self.scale_index = min(self.scale_index + 1, len(SCALES) - 1)
        elif key == "-":
            self.scale_index = max(self.scale_index - 1, 0)
        else:
            self.release()

    def release(self) -> None:
        """Forget the key."""
        self._key = None

    def command(self, now: float) -> tuple[float, float] | None:
        """Shares (−1…1) of the greatest speed and turn rate that the held key asks for; None: no key."""
        if self._key is None or now >= self._until:
            self._key = None
            return None
        ahead, left = _MOVES[self._key]
        return ahead * self.scale, left * self.scale
