"""A wire that misbehaves by a seeded plan: it loses, spoils and delays frames, but keeps their order."""

import random
from dataclasses import dataclass
from enum import IntEnum

import msgspec


class Direction(IntEnum):
    """Which way bytes go."""

    TO_DEVICE = 0
    TO_HOST = 1


class FaultPlan(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Probabilities per frame (or per piece, where bytes come in pieces), for one line.

    `drop` loses the frame, `flip` turns one to three of its bits, `insert` puts a byte into it, `double`
    sends it twice, `split` lets it come in two pieces up to `split_s` apart, `delay` holds it and what comes
    after it back by up to `delay_s`, `stall` stops the line both ways for `stall_s`, `hang_up` pulls the
    cable for `hang_up_s`. The plan acts from `start_s` to `end_s` after the line came up, and in the
    direction `to_device`, `to_host` or `both`.
    """

    seed: int | None = None
    drop: float = 0.0
    flip: float = 0.0
    insert: float = 0.0
    double: float = 0.0
    split: float = 0.0
    split_s: float = 0.005
    delay: float = 0.0
    delay_s: float = 0.3
    stall: float = 0.0
    stall_s: float = 0.5
    hang_up: float = 0.0
    hang_up_s: float = 1.0
    start_s: float = 0.0
    end_s: float = float("inf")
    direction: str = "both"

    def __post_init__(self) -> None:
        for name in self.__struct_fields__:
            value = getattr(self, name)
            if name in _PROBABILITIES and not 0 <= value <= 1:
                raise ValueError(f"{name} is {value}, must be a probability from 0 to 1")
            if name.endswith("_s") and not value >= 0:
                raise ValueError(f"{name} is {value}, must be 0 s or more")
        if self.direction not in _DIRECTIONS:
            raise ValueError(f"direction is {self.direction!r}, must be one of {', '.join(_DIRECTIONS)}")


_PROBABILITIES = frozenset({"drop", "flip", "insert", "double", "split", "delay", "stall", "hang_up"})
_DIRECTIONS = {
    "both": frozenset(Direction),
    "to_device": frozenset({Direction.TO_DEVICE}),
    "to_host": frozenset({Direction.TO_HOST}),
}


@dataclass(frozen=True, slots=True)
class Carried:
    """What becomes of one frame: pieces (each after a pause), a stall of the line, or a pulled cable."""

    pieces: tuple[tuple[float, bytes], ...]
    lost: bool = False
    stall_s: float = 0.0
    hang_up_s: float | None = None


class FaultyWire:
    """Applies a plan to one direction of a line, frame after frame, from its own random numbers."""

    def __init__(self, plan: FaultPlan, line: str, direction: Direction) -> None:
        self._plan = plan
        self._acts = direction in _DIRECTIONS[plan.direction]
        self._random = random.Random(f"wire {plan.seed} {line} {direction.name}")

    def carry(self, data: bytes, since_start: float) -> Carried:
        """Return what becomes of a frame that starts `since_start` seconds after the line came up."""
        plan, happens = self._plan, self._happens
        if not self._acts or not plan.start_s <= since_start < plan.end_s:
            return Carried(((0.0, data),))
        hang_up_s = plan.hang_up_s if happens(plan.hang_up) else None
        stall_s = plan.stall_s if happens(plan.stall) else 0.0
        pause = self._random.uniform(0, plan.delay_s) if happens(plan.delay) else 0.0
        if happens(plan.drop):
            return Carried(((pause, data),), True, stall_s, hang_up_s)
        if happens(plan.flip):
            data = self._flip(data)
        if happens(plan.insert):
            place = self._random.randrange(len(data) + 1)
            data = data[:place] + self._random.randbytes(1) + data[place:]
        pieces = [(pause, data)]
        if happens(plan.split) and len(data) > 1:
            place = self._random.randrange(1, len(data))
            gap = self._random.uniform(0, plan.split_s)
            pieces = [(pause, data[:place]), (gap, data[place:])]
        if happens(plan.double):
            pieces += [(0.0, piece) if n == 0 else (gap, piece) for n, (gap, piece) in enumerate(pieces)]
        return Carried(tuple(pieces), False, stall_s, hang_up_s)

    def _happens(self, probability: float) -> bool:
        return probability > 0 and self._random.random() < probability

    def _flip(self, data: bytes) -> bytes:
        spoilt = bytearray(data)
        for _ in range(self._random.randint(1, 3)):
            bit = self._random.randrange(8 * len(data))
            spoilt[bit // 8] ^= 1 << bit % 8
        return bytes(spoilt)
