"""What a reply's status means to the one who asked."""

from medusa.errors import STATUS_NAMES, CommandError, DeviceRestarted, MedusaError, ProtocolError
from medusa.link.frame import Message, encode_frame
from medusa.link.messages import WHOLE_DEVICE
from medusa.link.request import Request

NO_HELLO = 10


def refusal(reply: Message, request: Request, name: str) -> MedusaError:
    """Return the error for a reply whose status is not 0."""
    status = reply.axis
    asked = describe(reply.address, request, name)
    if status == NO_HELLO:
        return DeviceRestarted(f"{asked}: the device has restarted and lost its state (status 10)")
    if status not in STATUS_NAMES:
        return ProtocolError(f"{asked}: answered with the unknown status {status}", frame=encode_frame(reply))
    message = f"{asked}: {STATUS_NAMES[status]} (status {status})"
    return CommandError(message, status=status, operation=request.operation, axis=request.axis)


def describe(address: int, request: Request, name: str) -> str:
    """Return who was asked what, for messages."""
    axis = "" if request.axis == WHOLE_DEVICE else f" axis {request.axis}"
    return f"device {address:02X}H, {name}{axis}"
