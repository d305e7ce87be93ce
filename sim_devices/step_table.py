"""What a motor does in one whole sample period, for every motor command: computed once, looked up in the inner loop."""

from math import exp

from sim_devices.motor import Motor


class StepTable:
    """What one whole sample period adds, for each of the 256 motor commands (indexed by the command)."""

    def __init__(self, motor: Motor, period_s: float) -> None:
        tau = motor.constants.time_constant
        self.speeds = motor.speeds
        self.period_s = period_s
        self.decay = exp(-period_s / tau)
        self.reach = tau * (1.0 - self.decay)
        self.rest = period_s - self.reach
        gained = 1.0 - self.decay
        self.travels = [u * self.rest for u in self.speeds]
        self.gains = [u * gained for u in self.speeds]
