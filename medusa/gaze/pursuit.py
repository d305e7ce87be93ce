"""Smooth pursuit of one joint as in thesis 6.5.2 and 6.6: the PID's angle over the frame period, as a velocity."""

import math

from medusa.gaze.command import Position, Velocity
from medusa.gaze.pid import Gains, Pid


class JointPursuit:
    """From retinal error to a command of one joint, one step a picture.

    Velocity v = PID(e)/T_v, T_v the frame period, truncated to whole multiples of the least speed q, the
    joint's rate step. Below q the joint stalls, as the thesis
    observed, unless `microsaccades`: then it is stepped by the PID's angle in position mode. The integral is
    zeroed on a change of mode, because the sum that made a velocity would be applied as a jump.
    """

    def __init__(
        self, gains: Gains, frame_period: float, least_speed: float, *, microsaccades: bool = False
    ) -> None:
        if frame_period <= 0 or least_speed <= 0:
            raise ValueError(
                f"frame period {frame_period} s and least speed {least_speed} rad/s must be positive"
            )
        self._pid = Pid(gains)
        self._period, self._least = frame_period, least_speed
        self._microsaccades = microsaccades
        self._stepping = False

    def step(self, error: float, angle: float) -> Velocity | Position:
        """Command for a retinal error [rad] measured when the joint stood at `angle` [rad]."""
        turn = self._pid.step(error)
        slow = abs(turn) < self._least * self._period
        stepping = self._microsaccades and slow
        if stepping != self._stepping:
            self._stepping = stepping
            self._pid.forget_sum()
        if stepping:
            return Position(angle + turn)
        return Velocity(self._least * math.trunc(turn / self._period / self._least))

    def reset(self) -> None:
        """Start anew, as after a saccade."""
        self._pid.reset()
        self._stepping = False
