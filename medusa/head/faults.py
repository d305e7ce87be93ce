"""Why joints stopped by themselves: causes that every drive knows, and faults that name the joints."""

from dataclasses import dataclass
from enum import Enum

from medusa.errors import DeviceFault


class Cause(Enum):
    """Why a joint stopped by itself."""

    LIMIT = "limit switch"
    FOLLOWING = "following error"
    DRIVE = "drive fault"
    EMERGENCY_STOP = "emergency stop"
    WATCHDOG = "watchdog expired"
    STOP_INPUT = "stop input"
    RESTARTED = "restarted"
    LOST = "line lost"
    STALLED = "does not follow its commanded rate"
    SOFT_LIMIT = "soft limit"


@dataclass(frozen=True)
class Fault:
    """One fault: its cause, the joints it concerns, one line for people, the loop's time, s."""

    cause: Cause
    joints: tuple[str, ...]
    reason: str
    time: float

    @property
    def stops_all(self) -> bool:
        """True when the other joints have to stop, too; a joint held at its soft limit stops alone."""
        return self.cause is not Cause.SOFT_LIMIT


class JointFault(DeviceFault):
    """A joint stopped by itself; `report` names it and the cause."""

    def __init__(self, report: Fault, also: str = "") -> None:
        self.report = report
        names = ", ".join(report.joints)
        super().__init__(f"{names}: {report.reason}" + (f"; {also}" if also else ""), axis=names)
