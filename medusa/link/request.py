"""One request on its way through an exchange."""

from typing import Final

from medusa.link.frame import Message
from medusa.link.messages import CLEAR, HELLO, WHOLE_DEVICE
from medusa.link.operation import Operation
from medusa.link.reply_future import ReplyFuture

MAX_SENDINGS: Final = 3
BAD_LENGTH: Final = 3


class Request:
    """What is asked, how it depends on others, and how far it has come."""

    frame: bytes = b""
    sequence: int = -1
    sendings: int = 0
    order: int = 0
    due: float = 0.0
    first_sent: float = 0.0
    final: bool = False
    damaged: Message | None = None
    times_damaged: int = 0

    def __init__(
        self,
        operation: Operation,
        axis: int,
        payload: bytes,
        deadline: float,
        reply_size: int | None = None,
        reply: ReplyFuture | None = None,
    ) -> None:
        self.operation = operation
        self.axis = axis
        self.payload = payload
        self.deadline = deadline
        self.reads = operation.reads
        self.moves = operation.moves
        self.stops = operation.stops
        self.urgent = operation.urgent
        self.reply_size = operation.reply_size if reply_size is None else reply_size
        self.reply = reply

    def depends_on(self, earlier: "Request") -> bool:
        """Return whether this one must act after the earlier one."""
        if self.reads or earlier.reads:
            return False
        return self.axis == earlier.axis or self.axis == WHOLE_DEVICE or earlier.axis == WHOLE_DEVICE

    @property
    def gives_way(self) -> bool:
        """Whether a stop withdraws it: what can move anything, and CLEAR, which would undo the stop's latch."""
        return self.moves or self.operation is CLEAR

    @property
    def repeatable(self) -> bool:
        """Whether the same frame may still be sent again."""
        return self.sendings < MAX_SENDINGS and not self.final

    def is_answered_by(self, reply: Message) -> bool:
        """Whether it is the one the reply answers; a HELLO takes only its own nonce (a refusal has none)."""
        if self.operation is not HELLO:
            return reply.operation == self.operation.code
        return reply.operation == HELLO.code and (reply.axis != 0 or reply.payload[:2] == self.payload)

    def is_damaged_by(self, reply: Message) -> bool:
        """Whether the reply is of the wrong size, or refuses a right one as "bad length": worth a repeat."""
        if reply.axis == 0:
            return self.reply_size is not None and self.reply_size != len(reply.payload)
        return reply.axis == BAD_LENGTH and self.repeatable
