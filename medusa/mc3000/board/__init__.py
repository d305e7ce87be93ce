"""The three-axis servo board: registers, messages, driver."""

from medusa.mc3000.board.board import Board
from medusa.mc3000.board.messages import AxisSnapshot, BoardEvent, EventKind, Latched, Settings, Snapshot
from medusa.mc3000.board.profile import Profile, make_profile, profile_samples
from medusa.mc3000.board.registers import (
    FilterBytes,
    Flags,
    Inputs,
    LatchSource,
    Mode,
    Register,
    Status,
    WatchdogAction,
)

__all__ = [
    "AxisSnapshot",
    "Board",
    "BoardEvent",
    "EventKind",
    "FilterBytes",
    "Flags",
    "Inputs",
    "LatchSource",
    "Latched",
    "Mode",
    "Profile",
    "Register",
    "Settings",
    "Snapshot",
    "Status",
    "WatchdogAction",
    "make_profile",
    "profile_samples",
]
