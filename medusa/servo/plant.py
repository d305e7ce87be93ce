"""The plant as the chip sees it: DAC counts in, encoder counts out.

Thesis (6.2)–(6.7) and (6.15)–(6.17). The motor 1/K_E / (s (s T_M + 1)) behind DAC, amplifier and encoder is

    dv/dt = (C u − v)/T_M,    dx/dt = v,        C = K_D K_A E/K_E

with u in DAC counts, x in encoder counts, v in counts/s. Two numbers, T_M and C, are all the control design
needs. K_E, K_T, R and J are joint-referred: with the motor's own constants E must not contain the gear
(thesis (6.2), (6.7)).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

from medusa.servo.sampling import sample_period

if TYPE_CHECKING:
    from control import TransferFunction

K_D = 20 / 256
"""DAC factor in V per count, thesis (6.6)."""
DAC_MIN, DAC_MAX = -128, 127


def encoder_gain(lines: float, gear: float) -> float:
    """Counts per radian of the joint, E = 4 N G/2π, thesis (6.7)."""
    return 4 * lines * gear / (2 * math.pi)


@dataclass(frozen=True)
class DiscretePlant:
    """Zero-order-hold plant g (z + b)/((z − 1)(z − p)), thesis (6.4): counts per DAC count."""

    gain: float
    zero: float
    pole: float
    velocity_gain: float
    """C T (1 − p): numerator of the velocity plant (6.17), counts/sample per DAC count."""
    period: float

    def position(self) -> TransferFunction:
        """P(z) of thesis (6.8)–(6.10), counts per DAC count."""
        from control import TransferFunction

        g, b, p = self.gain, self.zero, self.pole
        return TransferFunction([g, g * b], [1.0, -1.0 - p, p], self.period)

    def velocity(self) -> TransferFunction:
        """P(z) of thesis (6.17), counts/sample per DAC count."""
        from control import TransferFunction

        return TransferFunction([self.velocity_gain], [1.0, -self.pole], self.period)


@dataclass(frozen=True)
class Plant:
    """A joint's plant: time constant T_M [s] and velocity gain C [counts/s per DAC count]."""

    time_constant: float
    velocity_gain: float

    def __post_init__(self) -> None:
        for name, value in (("time constant", self.time_constant), ("velocity gain", self.velocity_gain)):
            if not (math.isfinite(value) and value > 0):
                raise ValueError(f"a plant's {name} must be positive, not {value}")

    @classmethod
    def from_constants(
        cls,
        resistance: float,
        inertia: float,
        back_emf: float,
        torque: float,
        encoder: float,
        amplifier: float,
    ) -> Plant:
        """Plant from joint-referred R [Ω], J [kg m²], K_E [V s/rad], K_T [N m/A], E [counts/rad] and K_A.

        T_M = R J/(K_E K_T), thesis (6.5); C = K_D K_A E/K_E.
        """
        return cls(resistance * inertia / (back_emf * torque), K_D * amplifier * encoder / back_emf)

    @classmethod
    def from_discrete(cls, gain: float, pole: float, period: float) -> Plant:
        """Plant whose discretisation at `period` has gain g and pole p, thesis (6.4) solved for T_M and C."""
        time_constant = -period / math.log(pole)
        return cls(time_constant, gain / (period - time_constant * (1 - pole)))

    def back_emf(self, encoder: float, amplifier: float) -> float:
        """Joint-referred K_E = K_D K_A E/C in V s/rad."""
        return K_D * amplifier * encoder / self.velocity_gain

    def inertia(self, resistance: float, back_emf: float, torque: float) -> float:
        """Joint-referred J = T_M K_E K_T/R in kg m², thesis (6.5)."""
        return self.time_constant * back_emf * torque / resistance

    def scaled(self, time_constant: float = 1.0, velocity_gain: float = 1.0) -> Plant:
        """The same plant with T_M and C multiplied: a stand-in for what the model does not know."""
        return Plant(self.time_constant * time_constant, self.velocity_gain * velocity_gain)

    def discretise(self, period: float) -> DiscretePlant:
        """Zero-order-hold discretisation, thesis (6.4) and (6.17); b always from p.

        g = C (T − T_M (1 − p)), g b = C (T_M (1 − p) − T p), p = e^(−T/T_M).
        """
        p = math.exp(-period / self.time_constant)
        g = self.velocity_gain * (period - self.time_constant * (1 - p))
        b = (self.time_constant * (1 - p) - period * p) / (period - self.time_constant * (1 - p))
        return DiscretePlant(g, b, p, self.velocity_gain * period * (1 - p), period)

    def at_timer(self, timer: int) -> DiscretePlant:
        """Discretisation at the sample period of the chip's timer register."""
        return self.discretise(sample_period(timer))

    def advance(self, position: float, velocity: float, dac: float, duration: float) -> tuple[float, float]:
        """Position [counts] and velocity [counts/s] after `duration` under a constant DAC value, exactly."""
        final = self.velocity_gain * dac
        decay = math.exp(-duration / self.time_constant)
        moved = final * duration + (velocity - final) * self.time_constant * (1 - decay)
        return position + moved, final + (velocity - final) * decay

    @property
    def top_speed(self) -> float:
        """Counts/s that the largest DAC value, 127, drives the plant to."""
        return self.velocity_gain * DAC_MAX
