"""What a mobile base promises: the driver that a machine's author writes, and the base that programs drive."""

from labmate.base.driver import BaseDriver, Capabilities, Limits
from labmate.base.events import Bumper, Cause
from labmate.base.mobile_base import MobileBase
from labmate.base.motion import Motion
from labmate.base.reading import BaseReading
from labmate.base.report import MotionReport

__all__ = [
    "BaseDriver",
    "BaseReading",
    "Bumper",
    "Capabilities",
    "Cause",
    "Limits",
    "MobileBase",
    "Motion",
    "MotionReport",
]
