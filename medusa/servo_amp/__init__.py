"""The servo amplifiers: codec and driver."""

from medusa.servo_amp.amplifier import Amplifier
from medusa.servo_amp.line import AmplifierLine
from medusa.servo_amp.status import AmplifierStatus

__all__ = ["Amplifier", "AmplifierLine", "AmplifierStatus"]
