"""Proportional velocity mode: the bounds on its gain K, thesis (6.18)–(6.22) and table 6.2.

The loop is K C T (1 − p)/(z − p): one pole at p − K C T (1 − p) and, without an integrator, a steady error of
1/(1 + K C T) of the command. The print has K_E for K in the denominator of (6.21), and 3.5 where the
vergence's bound (ii) is 3.56; both are corrected here.
"""

import math
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.servo.plant import DiscretePlant, Plant
from medusa.servo.sampling import sample_period


@dataclass(frozen=True)
class VelocityBounds:
    """The three bounds on K of table 6.2 for a stated steady velocity error."""

    stability: float
    """(i) K below (1 + p)/(C T (1 − p)): the pole stays above −1, thesis (6.19)."""
    accuracy: float
    """(ii) K above (1 − err)/(err C T): the steady error stays below err, thesis (6.22)."""
    no_overshoot: float
    """(iii) K at most p/(C T (1 − p)): the pole stays at or above 0."""
    error_limit: float

    @property
    def accuracy_is_stable(self) -> bool:
        """Whether any stable gain meets the error bound: (i) and (ii) together."""
        return self.accuracy < self.stability

    @property
    def accuracy_without_overshoot(self) -> bool:
        """Whether (ii) and (iii) can be met together."""
        return self.accuracy < self.no_overshoot

    def statement(self) -> str:
        """One sentence on which bounds cannot both be met."""
        percent = f"{self.error_limit:.0%}"
        if not self.accuracy_is_stable:
            return (
                f"(i) and (ii) cannot both be met: an error below {percent} needs K > {self.accuracy:.2f}, "
                f"stability K < {self.stability:.2f}"
            )
        if not self.accuracy_without_overshoot:
            return (
                f"(ii) and (iii) cannot both be met: an error below {percent} needs K > {self.accuracy:.2f}, "
                f"a pole not below 0 K <= {self.no_overshoot:.2f}"
            )
        return f"all three can be met with {self.accuracy:.2f} < K <= {self.no_overshoot:.2f}"


def velocity_bounds(plant: DiscretePlant, error_limit: float = 0.1) -> VelocityBounds:
    """The bounds of table 6.2; `error_limit` is the steady error as a fraction of the command."""
    if not 0 < error_limit < 1:
        raise ValueError(f"the velocity error bound must lie between 0 and 1, not {error_limit}")
    p = plant.pole
    reach = plant.velocity_gain / (1 - p)
    return VelocityBounds(
        stability=(1 + p) / plant.velocity_gain,
        accuracy=(1 - error_limit) / (error_limit * reach),
        no_overshoot=p / plant.velocity_gain,
        error_limit=error_limit,
    )


def velocity_pole(plant: DiscretePlant, gain: float) -> float:
    """Closed-loop pole p − K C T (1 − p), thesis (6.18), which is right as printed."""
    return plant.pole - gain * plant.velocity_gain


def steady_velocity_ratio(plant: DiscretePlant, gain: float) -> float:
    """Steady speed over commanded speed, 1 − 1/(1 + K C T); with K of (iii) it is exactly p."""
    return 1 - 1 / (1 + gain * plant.velocity_gain / (1 - plant.pole))


def velocity_gain_register(gain: float) -> int:
    """The byte for register 22H nearest to K (n/4); raises CommandError outside 0..255."""
    register = round(gain * 4)
    if not 0 <= register <= 255:
        raise CommandError(f"velocity gain K = {gain:.4g} is outside the register's 0..{255 / 4}")
    return register


def check_velocity_stable(plant: DiscretePlant, gain: float) -> None:
    """Raise CommandError, with the pole and the greatest stable gain, when the velocity loop is not stable."""
    pole = velocity_pole(plant, gain)
    if not -1 < pole < 1:
        limit = velocity_bounds(plant).stability
        raise CommandError(
            f"proportional velocity gain K = {gain:.4g} is unstable at {plant.period * 1e3:.3f} ms: pole "
            f"{pole:.3f}; K must lie between 0 and {limit:.2f}"
        )


def design_velocity_register(plant: Plant, timer: int) -> int:
    """The thesis's choice for the mode: the byte nearest to (iii), and not above the stable ones."""
    discrete = plant.discretise(sample_period(timer))
    bounds = velocity_bounds(discrete)
    return max(1, min(velocity_gain_register(bounds.no_overshoot), math.ceil(bounds.stability * 4) - 1, 255))
