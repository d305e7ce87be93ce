"""The motor and its power stage as one shaft: what moves it, in encoder counts and seconds.

Speeds stand for torques: the motor's ẇ = (u − w)/T_M, u the speed at which the back-EMF equals the output
voltage, so u − w is the current times R/K_E. C = K_D K_A E/K_E is u for one count of motor command.
"""

from dataclasses import dataclass
from enum import Enum

from sim_devices.stretch import Exponential, Stretch, Uniform

K_D = 20 / 256
COAST = 10.0
# At the boundary itself the limit no longer acts, whatever the rounding.
_ABOVE = 1.0 + 1e-12


class Bridge(Enum):
    """What the power stage does with the motor."""

    ENABLED = "enabled"
    BRAKED = "braked"
    INHIBITED = "inhibited"


@dataclass(frozen=True)
class MotorConstants:
    """A joint's motor: T_M in s, C in counts/s per DAC count, E in counts/rad, K_A in V/V, R in Ω.

    `friction_counts`: Coulomb friction and stiction, as the motor command that just overcomes it.
    """

    time_constant: float
    gain: float
    counts_per_radian: float
    amplifier_gain: float
    resistance: float = 4.0
    friction_counts: float = 0.0

    @property
    def back_emf(self) -> float:
        """K_E = K_D K_A E/C, joint-referred, V s/rad."""
        return K_D * self.amplifier_gain * self.counts_per_radian / self.gain

    @property
    def speed_per_volt(self) -> float:
        """E/K_E: counts/s at which the back-EMF is one volt."""
        return self.counts_per_radian / self.back_emf

    @property
    def amperes_per_speed(self) -> float:
        """K_E/(E R): amperes for one count/s of u − w."""
        return 1.0 / (self.speed_per_volt * self.resistance)


class Motor:
    """The drive of one shaft: `stretch(w)` is its motion from speed w until a boundary speed.

    `command` is −128..127, `positive_blocked` and `negative_blocked` are the directional inhibits, `limit`
    the speed difference that the current limit allows.
    """

    def __init__(self, constants: MotorConstants, bus_volts: float, peak: float, continuous: float) -> None:
        self.constants = constants
        self.bridge = Bridge.INHIBITED
        self.held_at_zero = False
        self.positive_blocked = False
        self.negative_blocked = False
        self.command = 0
        self.friction = constants.friction_counts * constants.gain
        self.speeds = [0.0] * 256
        self.set_currents(peak, continuous)
        self.set_bus(bus_volts)

    def set_bus(self, volts: float) -> None:
        """Clamp the output to the bus: |V| ≤ volts."""
        if volts < 0:
            raise ValueError(f"bus voltage is {volts} V, must be 0 or more")
        self.bus_volts = volts
        constants = self.constants
        step = K_D * constants.amplifier_gain
        # Indexed by the motor command itself: −128..−1 are the last 128 places.
        self.speeds = [
            constants.speed_per_volt * min(max(step * command, -volts), volts)
            for command in (*range(128), *range(-128, 0))
        ]
        self._set_limit()
        self.apply()

    def set_currents(self, peak: float, continuous: float) -> None:
        """Set the current limits in amperes; they fall back to the continuous one in foldback."""
        if not 0 < continuous <= peak:
            raise ValueError(f"currents are {continuous} A continuous, {peak} A peak: 0 < continuous <= peak")
        self.peak, self.continuous = peak, continuous
        self.folded = False
        self.overload_s = 0.0
        self.continuous_speed = continuous / self.constants.amperes_per_speed
        self._set_limit()

    def _set_limit(self) -> None:
        self.limit = (self.continuous if self.folded else self.peak) / self.constants.amperes_per_speed
        top, bottom = max(self.speeds), -min(self.speeds)
        self.limit_can_act = top + bottom > self.limit or max(top, bottom) > self.continuous_speed
        """Whether any motor command could bring a current limit into play."""

    def apply(self) -> None:
        """Take over a changed command, bridge or bus."""
        live = self.bridge is Bridge.ENABLED and not self.held_at_zero
        self.target = self.speeds[self.command] if live else 0.0

    def overload(self, w: float, dt: float, longest: float) -> None:
        """Count the time above the continuous current; after `longest` seconds fold the limit back."""
        if self.bridge is Bridge.ENABLED and abs(self.target - w) > self.continuous_speed:
            self.overload_s += dt
        else:
            self.overload_s = 0.0
        folded = self.overload_s >= longest
        if folded != self.folded:
            self.folded = folded
            self._set_limit()

    def torque(self, w: float) -> float:
        """Return the motor's torque at speed w, as a speed difference: limited, and not into a closed switch."""
        difference = self.target - w
        if self.bridge is Bridge.INHIBITED:
            return difference / COAST
        if self.bridge is Bridge.ENABLED:
            difference = min(max(difference, -self.limit), self.limit)
            if self.positive_blocked and difference > 0.0:
                return 0.0
            if self.negative_blocked and difference < 0.0:
                return 0.0
        return difference

    def current(self, w: float) -> float:
        """Return the current in amperes at speed w; none flows through an inhibited bridge."""
        return 0.0 if self.bridge is Bridge.INHIBITED else self.torque(w) * self.constants.amperes_per_speed

    def demand(self, w: float) -> float:
        """Return the current that the command asks for before any limit, in amperes."""
        asked = self.target - w if self.bridge is Bridge.ENABLED else 0.0
        return asked * self.constants.amperes_per_speed

    def stretch(self, w: float, way: int) -> tuple[Stretch, float | None]:
        """Return the motion from speed w going `way` (±1), and the speed at which its law changes, if any."""
        tau, friction, u = self.constants.time_constant, way * self.friction, self.target
        if self.bridge is Bridge.INHIBITED:
            return Exponential(w, -COAST * friction, COAST * tau), None
        if self.bridge is Bridge.BRAKED:
            return Exponential(w, -friction, tau), None
        blocked = self.positive_blocked, self.negative_blocked
        if (blocked[0] and (u > w or (u == w and friction > 0.0))) or (
            blocked[1] and (u < w or (u == w and friction < 0.0))
        ):
            return Uniform(w, -friction / tau), u
        if abs(u - w) > self.limit * _ABOVE:
            push = self.limit if u > w else -self.limit
            return Uniform(w, (push - friction) / tau), u - push
        return Exponential(w, u - friction, tau), u if blocked[0] or blocked[1] else None
