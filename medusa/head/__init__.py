"""The head as named joints in radians over a drive: what a drive promises, and what is the same for every drive."""

from medusa.head.drive import (
    Capabilities,
    Drive,
    Homed,
    JointState,
    JointTraits,
    MoveEnds,
    MovePlan,
    Mover,
    Reading,
    Speeds,
)
from medusa.head.faults import Cause, Fault, JointFault
from medusa.head.joint_group import JointGroup, Rates
from medusa.head.moves import MoveReport, MoveStopped
from medusa.head.polled_drive import PolledDrive

__all__ = [
    "Capabilities",
    "Cause",
    "Drive",
    "Fault",
    "Homed",
    "JointFault",
    "JointGroup",
    "JointState",
    "JointTraits",
    "MoveEnds",
    "MovePlan",
    "MoveReport",
    "MoveStopped",
    "Mover",
    "PolledDrive",
    "Rates",
    "Reading",
    "Speeds",
]
