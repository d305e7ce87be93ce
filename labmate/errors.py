"""What can go wrong with the base beyond the link's own errors, and whose fault it was."""

from __future__ import annotations

from typing import ClassVar

from medusa.errors import CommandError, DeviceFault, MedusaError, Origin


class MotionStopped(DeviceFault):
    """A motion ended before its goal, or by something else than its program; `reason` is one word or two.

    `report` is the MotionReport of a GO or TURN whose end the base reported (None otherwise).
    """

    def __init__(self, message: str, *, reason: str, report: object | None = None) -> None:
        super().__init__(message)
        self.reason = reason
        self.report = report


class StopNotConfirmed(DeviceFault):
    """The base was stopped, and not read at rest afterwards."""


class StalePose(MedusaError):
    """A pose too old to steer by."""

    origin: ClassVar[Origin] = "line"


class BatteryLow(CommandError):
    """A GO is not begun on a low battery."""
