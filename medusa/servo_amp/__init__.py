"""The servo amplifiers: codec and driver."""

from medusa.servo_amp.amplifier import Amplifier, AmplifierLine, AmplifierStatus

__all__ = ["Amplifier", "AmplifierLine", "AmplifierStatus"]
