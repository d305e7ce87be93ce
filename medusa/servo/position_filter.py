"""The chip's compensation filter D(z) = K (z − A)/(z + B) and the loop it closes, thesis (6.1), (6.8)–(6.14).

The registers hold A = n/256, B = n/256 and K = n/4, so the exact double pole of (6.11) is out of reach:
what the nearest bytes really give is `closed_loop_poles` of the filter they make.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from medusa.errors import CommandError
from medusa.servo.plant import DiscretePlant
from medusa.servo.sampling import sample_period

if TYPE_CHECKING:
    from control import TransferFunction


@dataclass(frozen=True)
class Filter:
    """D(z) = K (z − A)/(z + B), thesis (6.1); the pole lies at −B. DAC counts per encoder count."""

    zero: float
    pole: float
    gain: float

    @property
    def static_gain(self) -> float:
        """D(1) = K (1 − A)/(1 + B), DAC counts per count of constant error."""
        return self.gain * (1 - self.zero) / (1 + self.pole)

    def transfer_function(self, period: float) -> TransferFunction:
        """D(z) as a python-control transfer function."""
        from control import TransferFunction

        return TransferFunction([self.gain, -self.gain * self.zero], [1.0, self.pole], period)


@dataclass(frozen=True)
class FilterRegisters:
    """The bytes of FILTER: zero 20H (n/256), pole 21H (n/256), gain 22H (n/4), sample timer 0FH."""

    zero: int
    pole: int
    gain: int
    timer: int

    def __post_init__(self) -> None:
        for name, value in (("A", self.zero), ("B", self.pole), ("K", self.gain)):
            if not 0 <= value <= 255:
                raise CommandError(f"filter register {name} = {value} is outside 0..255")
        sample_period(self.timer)

    @property
    def filter(self) -> Filter:
        """The filter these bytes make."""
        return Filter(self.zero / 256, self.pole / 256, self.gain / 4)

    @property
    def period(self) -> float:
        """Sample period in seconds."""
        return sample_period(self.timer)


def design_double_pole(plant: DiscretePlant) -> Filter:
    """The thesis's controller, (6.11)–(6.14): A cancels the plant's pole p, B = 0, K gives a double pole.

    With k = K g the loop's polynomial is z² + (k − 1) z + k b; its discriminant vanishes at
    k = (1 + 2 b) − 2 √(b² + b), the smaller root, and the double pole is (1 − k)/2.
    """
    b = plant.zero
    k = (1 + 2 * b) - 2 * math.sqrt(b * b + b)
    return Filter(plant.pole, 0.0, k / plant.gain)


def double_pole_gains(plant: DiscretePlant) -> tuple[float, float]:
    """Both gains K with a double pole of the compensated loop: breakaway and re-entry."""
    b = plant.zero
    root = 2 * math.sqrt(b * b + b)
    return ((1 + 2 * b) - root) / plant.gain, ((1 + 2 * b) + root) / plant.gain


def uncompensated_breakaway(plant: DiscretePlant) -> tuple[float, float]:
    """Gain and place on the real axis where the poles of the uncompensated loop meet (figure 6.5).

    Double root of z² − (1 + p − k) z + p + k b, k = K g: the smaller k of (1 + p − k)² = 4 (p + k b).
    """
    p, b = plant.pole, plant.zero
    half = (1 + p) + 2 * b
    k = half - math.sqrt(half * half - (1 - p) ** 2)
    return k / plant.gain, (1 + p - k) / 2


def compensated_gain_limit(plant: DiscretePlant) -> float:
    """Least unstable K with A = p, B = 0: the product of the poles, K g b, reaches 1."""
    return 1 / (plant.gain * plant.zero)


def uncompensated_gain_limit(plant: DiscretePlant) -> float:
    """Least unstable K of a purely proportional loop (figure 6.5): p + K g b reaches 1."""
    return (1 - plant.pole) / (plant.gain * plant.zero)


def characteristic_polynomial(plant: DiscretePlant, controller: Filter) -> NDArray[np.float64]:
    """(z − 1)(z − p)(z + B) + K g (z + b)(z − A), thesis (6.11), highest power first. Shape (4,)."""
    open_loop = np.polymul(np.polymul([1.0, -1.0], [1.0, -plant.pole]), [1.0, controller.pole])
    loop = controller.gain * plant.gain * np.polymul([1.0, plant.zero], [1.0, -controller.zero])
    return np.asarray(np.polyadd(open_loop, loop), dtype=np.float64)


def closed_loop_poles(plant: DiscretePlant, controller: Filter) -> NDArray[np.complex128]:
    """The three poles of the position loop, greatest magnitude first. Shape (3,)."""
    poles = np.roots(characteristic_polynomial(plant, controller)).astype(np.complex128)
    return poles[np.argsort(-np.abs(poles), kind="stable")]


def check_stable(plant: DiscretePlant, controller: Filter) -> None:
    """Raise CommandError, with the greatest pole, when the position loop is not stable."""
    greatest = float(np.abs(closed_loop_poles(plant, controller))[0])
    if not greatest < 1:
        raise CommandError(
            f"filter A = {controller.zero:.4g}, B = {controller.pole:.4g}, K = {controller.gain:.4g} is "
            f"unstable at {plant.period * 1e3:.3f} ms: a pole of magnitude {greatest:.4f}, allowed below 1"
        )


def nearest_registers(controller: Filter, timer: int) -> FilterRegisters:
    """The bytes nearest to a filter; raises CommandError where it lies outside the registers."""
    bytes_ = (round(controller.zero * 256), round(controller.pole * 256), round(controller.gain * 4))
    return FilterRegisters(*bytes_, timer)


def floor_gain_registers(controller: Filter, timer: int) -> FilterRegisters:
    """The nearest bytes of A and B with K rounded down: real poles, slower (equations page 1.5)."""
    near = nearest_registers(controller, timer)
    return FilterRegisters(near.zero, near.pole, math.floor(controller.gain * 4), timer)


def velocity_constant(velocity_gain: float, controller: Filter) -> float:
    """K_v = C D(1) in 1/s: a ramp of v counts/s is followed v/K_v counts behind."""
    return velocity_gain * controller.static_gain


def dead_band(controller: Filter, friction_dac: float = 0.0) -> float:
    """Largest constant error in counts that moves nothing: (1 + friction)/D(1), the DAC truncating."""
    return (1 + friction_dac) / controller.static_gain
