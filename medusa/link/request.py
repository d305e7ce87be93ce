"""One request on its way through an exchange."""

from asyncio import Future
from typing import Final

from medusa.link.frame import Message
from medusa.link.messages import CLEAR, EMERGENCY_STOP, HELLO, PING, STATISTICS, WHOLE_DEVICE

MAX_SENDINGS: Final = 3
BAD_LENGTH: Final = 3


class Request:
    """What is asked, how it depends on others, and how far it has come."""

    __slots__ = (
        "axis",
        "damaged",
        "deadline",
        "due",
        "final",
        "frame",
        "future",
        "moves",
        "number",
        "operation",
        "order",
        "payload",
        "reads",
        "reply_size",
        "sendings",
        "stops",
        "times_damaged",
        "urgent",
    )

    def __init__(
        self,
        operation: int,
        axis: int,
        payload: bytes,
        deadline: float,
        *,
        reads: bool = False,
        moves: bool = False,
        stops: bool = False,
        urgent: bool | None = None,
        reply_size: int | None = None,
        future: "Future[bytes] | None" = None,
    ) -> None:
        self.operation = operation
        self.axis = axis
        self.payload = payload
        self.deadline = deadline
        self.reads = reads or operation in (PING, STATISTICS)
        self.moves = moves
        self.stops = stops or operation in (HELLO, EMERGENCY_STOP, CLEAR)
        if urgent is None:
            urgent = self.stops and operation not in (HELLO, CLEAR)
        self.urgent = urgent
        self.reply_size = reply_size
        self.damaged: Message | None = None
        self.times_damaged = 0
        self.future = future
        self.frame = b""
        self.number = -1
        self.sendings = 0
        self.order = 0
        self.due = 0.0
        self.final = False

    def depends_on(self, earlier: "Request") -> bool:
        """Return whether this one must act after the earlier one."""
        if self.reads or earlier.reads:
            return False
        return self.axis == earlier.axis or self.axis == WHOLE_DEVICE or earlier.axis == WHOLE_DEVICE

    @property
    def gives_way(self) -> bool:
        """Whether a stop withdraws it: what can move anything, and CLEAR, which would undo the stop's latch."""
        return self.moves or self.operation == CLEAR

    @property
    def repeatable(self) -> bool:
        """Whether the same frame may still be sent again."""
        return self.sendings < MAX_SENDINGS and not self.final

    def is_answered_by(self, reply: Message) -> bool:
        """Whether it is the one the reply answers; a HELLO takes only its own nonce (a refusal has none)."""
        if reply.operation != self.operation:
            return False
        return self.operation != HELLO or reply.axis != 0 or reply.payload[:2] == self.payload

    def is_damaged_by(self, reply: Message) -> bool:
        """Whether the reply is of the wrong size, or says "bad length" to a right one: worth a repeat."""
        if reply.axis == BAD_LENGTH:
            return self.repeatable
        return reply.axis == 0 and self.reply_size not in (None, len(reply.payload))
