"""Which error ends a command with which code: the table of docs/cli.md, for head and base."""

import pytest

from labmate.errors import BatteryLow, MotionStopped, StalePose, StopNotConfirmed
from medusa.console.exit_codes import exit_code
from medusa.errors import (
    CommandError,
    ConfigError,
    DeviceFault,
    DeviceRestarted,
    DeviceSilent,
    NoReply,
    PortError,
    ProtocolError,
    Withdrawn,
)
from medusa.head.moves import MoveStopped
from perception.camera.errors import CameraLost


@pytest.mark.parametrize(
    ("error", "code"),
    [
        (CommandError("over the limit"), 2),
        (BatteryLow("low"), 2),
        (MoveStopped("stopped on the way"), 2),
        (ConfigError("head.toml", "", None, "is not TOML"), 3),
        (PortError("/dev/ttyUSB0", "busy"), 4),
        (FileNotFoundError("trace"), 4),
        (CameraLost("unplugged"), 4),
        (NoReply("STATUS"), 5),
        (ProtocolError("a reply of 3 bytes"), 5),
        # Nothing for a second is no answer, and no fault of the machine's that would have stopped it.
        (DeviceSilent("board 01H"), 5),
        (Withdrawn("MOVE"), 5),
        (StalePose("0.3 s old"), 5),
        (DeviceFault("pan: following error"), 6),
        (DeviceRestarted("board 01H restarted"), 6),
        (MotionStopped("front bumper", reason="front bumper"), 6),
        (StopNotConfirmed("still moving"), 6),
    ],
    ids=lambda value: type(value).__name__ if isinstance(value, Exception) else None,
)
def test_an_error_ends_with_the_documented_code(error: Exception, code: int) -> None:
    assert exit_code(error) == code
