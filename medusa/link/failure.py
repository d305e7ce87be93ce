"""How requests fail, in words: who was asked what, whose fault it was, and whether it may have acted."""

from typing import Final

from medusa.errors import (
    STATUS_NAMES,
    CommandError,
    DeviceRestarted,
    DeviceSilent,
    MedusaError,
    NoReply,
    ProtocolError,
    Withdrawn,
)
from medusa.link.frame import Message, encode_frame
from medusa.link.messages import WHOLE_DEVICE
from medusa.link.request import Request

NO_HELLO: Final = 10


class Failures:
    """Makes the errors of one device's requests."""

    def __init__(self, address: int) -> None:
        self._address = address

    def refused(self, request: Request, reply: Message) -> MedusaError:
        """Return the error for a reply whose status is not 0."""
        status, asked = reply.axis, self._asked(request)
        if status == NO_HELLO:
            return DeviceRestarted(f"{asked}: the device has restarted and lost its state (status 10)")
        if status not in STATUS_NAMES:
            return ProtocolError(
                f"{asked}: answered with the unknown status {status}", frame=encode_frame(reply)
            )
        text = f"{asked}: {STATUS_NAMES[status]} (status {status})"
        return CommandError(text, status=status, operation=request.operation.code, axis=request.axis)

    def unanswered(self, request: Request, reason: str, gone: bool) -> MedusaError:
        """Return the error for one that got no answer, or to every sending one of the wrong size."""
        reply = request.damaged
        if reply is not None and reply.axis == 0 and request.times_damaged >= request.sendings:
            text = (
                f"{self._asked(request)}: answered {len(reply.payload)} bytes, {request.reply_size} expected"
            )
            return ProtocolError(text, frame=encode_frame(reply))
        return NoReply(f"{self._asked(request)}: {reason}", frame=request.frame, may_have_acted=gone)

    def withdrawn(self, request: Request, gone: bool, reason: str) -> Withdrawn:
        """Return the error for one that gave way to a stop, or that a gap ended."""
        text = f"{self._asked(request)}: withdrawn {reason}"
        return Withdrawn(text, frame=request.frame, may_have_acted=gone)

    def silent(self, request: Request, reason: str) -> DeviceSilent:
        """Return the error for one to a device that does not answer."""
        text = f"{self._asked(request)}: {reason}"
        return DeviceSilent(text, frame=request.frame, may_have_acted=request.sendings > 0)

    def no_session(self, request: Request) -> CommandError:
        """Return the error for one before any HELLO was answered."""
        text = f"{self._asked(request)}: no session is open"
        return CommandError(text, operation=request.operation.code, axis=request.axis)

    def _asked(self, request: Request) -> str:
        axis = "" if request.axis == WHOLE_DEVICE else f" axis {request.axis}"
        return f"device {self._address:02X}H, {request.operation.name}{axis}"
