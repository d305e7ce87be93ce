"""What a device can be asked for, as data: one row an operation."""

from dataclasses import dataclass
from typing import Final, Literal

from medusa.link.layout import Layout

NOTHING: Final = Layout("an empty payload")


@dataclass(frozen=True, slots=True, eq=False)
class Operation:
    """One operation of a device: its number and name, its fields and axis, and what a request of it does.

    `axis`: whether a request is for one axis, for the whole device (0FH), or may be for either.
    Exactly one of these holds; without any of the three flags it acts:

    - `reads`: changes nothing that another request depends on; such requests overlap freely (up to four);
    - acts: waits while a request that acts on the same axis (0FH: any) is unanswered;
    - `moves`: acts, and can move something: withdrawn by a stop, never sent again by a reconnection;
    - `stops`: withdraws every unanswered motion first.

    `urgent`: a stop that needs no free place in the window; it is carried through although its caller is
    cancelled. A reply of another size than `reply` is damage; None: its size varies.
    """

    code: int
    name: str
    request: Layout = NOTHING
    reply: Layout | None = NOTHING
    axis: Literal["one", "whole", "either"] = "whole"
    reads: bool = False
    moves: bool = False
    stops: bool = False
    urgent: bool = False

    def __post_init__(self) -> None:
        if self.reads + self.moves + self.stops > 1 or (self.urgent and not self.stops):
            raise ValueError(f"{self.name}: it reads, acts, moves or stops, and only a stop is urgent")

    @property
    def reply_size(self) -> int | None:
        """Bytes in the payload of a good reply; None: any."""
        return None if self.reply is None else self.reply.size
