"""What an MC3000 board can be asked for: one row an operation (docs/protocols: MC3000, the board).

What WRITE and MODE do depends on what they carry, so each has a row for every case, all of one code and name;
`write_of` and `mode_of` choose it.
"""

from typing import Final

from medusa.link.layout import Field, Layout
from medusa.link.operation import Operation
from medusa.mc3000.board.registers import MOVING, Mode, Register

AXES: Final = 3

SNAPSHOT_REPLY: Final = Layout(
    "SNAPSHOT",
    Field("time_us", "I"),
    *(
        *(Field("actual", "i"), Field("command", "i"), Field("status", "B")),
        *(Field("flags", "B"), Field("motor_command", "B"), Field("inputs", "B")),
    )
    * AXES,
)
POSITION_REPLY: Final = Layout("POSITION", Field("actual", "i"))
INPUTS_REPLY: Final = Layout("INPUTS", Field("inputs", "B"))
LATCHED_REPLY: Final = Layout(
    "LATCHED", Field("source", "B"), Field("caught", "B"), Field("position", "i"), Field("time_us", "I")
)
SETTINGS_REPLY: Final = Layout(
    "SETTINGS",
    *(Field("mode", "B"), Field("following_limit", "H"), Field("limit_enable", "B"), Field("armed", "B")),
)
_WRITE: Final = Layout("WRITE", Field("register", "B"))
_MODE: Final = Layout("MODE", Field("mode", "B"))

READ: Final = Operation(
    0x10, "READ", Layout("READ", Field("register", "B"), Field("count", "B")), None, axis="one", reads=True
)
"""Answers as many bytes as it was asked for."""
WRITE: Final = Operation(0x11, "WRITE", _WRITE, axis="one")
"""Behind the register come 1 to 8 bytes for it and those that follow it."""
WRITE_THAT_MOVES: Final = Operation(0x11, "WRITE", _WRITE, axis="one", moves=True)
WRITE_THAT_STOPS: Final = Operation(0x11, "WRITE", _WRITE, axis="one", stops=True)
POSITION: Final = Operation(0x12, "POSITION", reply=POSITION_REPLY, axis="one", reads=True)
COMMAND: Final = Operation(0x13, "COMMAND", Layout("COMMAND", Field("position", "i")), axis="one", moves=True)
SNAPSHOT: Final = Operation(0x14, "SNAPSHOT", reply=SNAPSHOT_REPLY, reads=True)
FILTER: Final = Operation(
    0x15, "FILTER", Layout("FILTER", *(Field(name, "B") for name in ("A", "B", "K", "T"))), axis="one"
)
MODE: Final = Operation(0x16, "MODE", _MODE, axis="one", moves=True)
MODE_IDLE: Final = Operation(0x16, "MODE", _MODE, axis="one", stops=True)
VELOCITY: Final = Operation(
    0x17, "VELOCITY", Layout("VELOCITY", Field("velocity", "h")), axis="one", moves=True
)
PROFILE: Final = Operation(
    0x18, "PROFILE", Layout("PROFILE", Field("acceleration_256", "H"), Field("maximum", "B")), axis="one"
)
MOVE: Final = Operation(
    0x19, "MOVE", Layout("MOVE", Field("final", "i"), Field("start", "B")), axis="one", moves=True
)
START: Final = Operation(0x1A, "START", Layout("START", Field("mask", "B")), moves=True)
PRESET: Final = Operation(0x1B, "PRESET", Layout("PRESET", Field("actual", "i")), axis="one")
INPUTS: Final = Operation(0x1C, "INPUTS", reply=INPUTS_REPLY, axis="one", reads=True)
LATCH: Final = Operation(0x1D, "LATCH", Layout("LATCH", Field("source", "B")), axis="one")
LIMIT_ENABLE: Final = Operation(
    0x1E, "LIMIT_ENABLE", Layout("LIMIT_ENABLE", Field("enable", "B")), axis="one"
)
FOLLOWING: Final = Operation(0x1F, "FOLLOWING", Layout("FOLLOWING", Field("limit", "H")), axis="one")
STOP: Final = Operation(0x20, "STOP", axis="either", stops=True, urgent=True)
LATCHED: Final = Operation(0x21, "LATCHED", reply=LATCHED_REPLY, axis="one", reads=True)
SETTINGS: Final = Operation(0x22, "SETTINGS", reply=SETTINGS_REPLY, axis="one", reads=True)

OPERATIONS: Final = (
    *(READ, WRITE, WRITE_THAT_MOVES, WRITE_THAT_STOPS, POSITION, COMMAND, SNAPSHOT, FILTER),
    *(MODE, MODE_IDLE, VELOCITY, PROFILE, MOVE, START, PRESET, INPUTS, LATCH, LIMIT_ENABLE),
    *(FOLLOWING, STOP, LATCHED, SETTINGS),
)
"""What a board can be asked for beyond what every device can."""


def write_of(register: int, values: bytes) -> Operation:
    """The row of a WRITE: 00 or 01 in 05H idles the axis; what else touches a motion register moves it."""
    if register == Register.PROGRAM_COUNTER and values in (b"\x00", b"\x01"):
        return WRITE_THAT_STOPS
    touched = range(register, register + len(values))
    return WRITE_THAT_MOVES if any(address in MOVING for address in touched) else WRITE


def mode_of(mode: Mode) -> Operation:
    """The row of a MODE: idle stops the axis, control may move it."""
    return MODE_IDLE if mode is Mode.IDLE else MODE
