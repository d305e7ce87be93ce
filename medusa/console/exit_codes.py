"""What a command line exits with, and which error means what."""

from medusa.errors import MedusaError, ProtocolError

DONE = 0
UNPRINTABLE = 1
USAGE = 2
CONFIGURATION = 3
PORT = 4
NO_ANSWER = 5
FAULT = 6
SIGNAL = 128
"""Plus the signal's number: interrupted, and the stop confirmed."""

_OF_ORIGIN = {
    "caller": USAGE,
    "configuration": CONFIGURATION,
    "port": PORT,
    "line": NO_ANSWER,
    "device": FAULT,
    "unknown": FAULT,
}


def exit_code(error: Exception) -> int:
    """The exit code of an expected error; what is no MedusaError is a port, a file or a camera (docs/cli.md)."""
    if not isinstance(error, MedusaError):
        return PORT
    # No answer, or a wrong one, is the same to the user, whether line or device was at fault.
    return NO_ANSWER if isinstance(error, ProtocolError) else _OF_ORIGIN[error.origin]


def epilog(machine: str) -> str:
    """The exit codes in the words of --help."""
    return (
        "Exit codes: 0 done, 2 wrong arguments or a command that cannot be done, 3 configuration, 4 port, file or"
        f" camera, 5 no answer or a wrong one, 6 the {machine} stopped by a fault or its stop not confirmed,"
        " 129, 130 and 143 interrupted and stopped."
    )
