"""What can go wrong with the base beyond the link's own errors, and whose fault it was."""

from __future__ import annotations

from typing import TYPE_CHECKING, ClassVar

from medusa.errors import CommandError, DeviceFault, DeviceRestarted, HostGap, MedusaError, Origin

if TYPE_CHECKING:
    from labmate.base.checks import MotionReport


class MotionStopped(DeviceFault):
    """A motion ended before its goal, or steering was taken away; `reason` is one word or two.

    `report` is there for a GO or TURN whose end the base told (None otherwise).
    """

    def __init__(self, message: str, *, reason: str, report: MotionReport | None = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.report = report


def out_of_reach(error: MedusaError) -> MotionStopped:
    """What a lost line, a restart or a gap in feeding means for whatever was moving."""
    reasons: dict[type[MedusaError], str] = {DeviceRestarted: "restart", HostGap: "watchdog"}
    stopped = MotionStopped(f"the motion ended: {error}", reason=reasons.get(type(error), "line lost"))
    stopped.__cause__ = error
    return stopped


class StopNotConfirmed(DeviceFault):
    """The base was told to stop and did not say that it stands."""


class StalePose(MedusaError):
    """A pose too old to steer by."""

    origin: ClassVar[Origin] = "line"


class BatteryLow(CommandError):
    """A GO is not begun on a low battery."""
