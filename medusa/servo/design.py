"""The whole design of one kind of joint at one sample period: what tables 6.1–6.3 and (6.8)–(6.14) hold."""

import math
from dataclasses import dataclass
from typing import Any

from medusa.errors import CommandError
from medusa.servo.limits import AxisScale
from medusa.servo.margins import ServoMargins, margins
from medusa.servo.plant import DiscretePlant, Plant
from medusa.servo.position_filter import (
    Filter,
    FilterRegisters,
    closed_loop_poles,
    compensated_gain_limit,
    dead_band,
    design_double_pole,
    nearest_registers,
    uncompensated_breakaway,
    uncompensated_gain_limit,
    velocity_constant,
)
from medusa.servo.velocity import VelocityBounds, design_velocity_register, velocity_bounds


@dataclass(frozen=True)
class ServoDesign:
    """The thesis's design for a plant at one sample timer, with what its bytes really give."""

    scale: AxisScale
    plant: Plant
    discrete: DiscretePlant
    filter: Filter
    registers: FilterRegisters
    poles: tuple[complex, complex, complex]
    """Of the loop with the registers, greatest magnitude first."""
    margins: ServoMargins
    uncompensated_limit: float
    compensated_limit: float
    breakaway: tuple[float, float]
    velocity: VelocityBounds
    velocity_register: int

    def as_dict(self) -> dict[str, Any]:
        """JSON: SI units and counts, degrees where the key ends so."""
        real = self.registers.filter
        return {
            "sample_period_s": self.discrete.period,
            "counts_per_degree": self.scale.counts_per_radian * math.pi / 180,
            "plant": {
                "time_constant_s": self.plant.time_constant,
                "velocity_gain_counts_s": self.plant.velocity_gain,
                "gain": self.discrete.gain,
                "zero": self.discrete.zero,
                "pole": self.discrete.pole,
            },
            "position": {
                "zero": self.filter.zero,
                "pole": self.filter.pole,
                "gain": self.filter.gain,
                "gain_limit": self.compensated_limit,
                "gain_limit_uncompensated": self.uncompensated_limit,
                "breakaway_gain_uncompensated": self.breakaway[0],
                "registers": {
                    "A": self.registers.zero,
                    "B": self.registers.pole,
                    "K": self.registers.gain,
                    "T": self.registers.timer,
                },
                "poles": [[pole.real, pole.imag] for pole in self.poles],
                "gain_margin": self.margins.gain,
                "phase_margin_deg": self.margins.phase_deg,
                "dead_band_counts": dead_band(real),
                "velocity_constant_1_s": velocity_constant(self.plant.velocity_gain, real),
            },
            "velocity": {
                "stability_max": self.velocity.stability,
                "accuracy_min": self.velocity.accuracy,
                "no_overshoot_max": self.velocity.no_overshoot,
                "register_K": self.velocity_register,
                "statement": self.velocity.statement(),
            },
            "speeds_deg_s": {
                "least": math.degrees(self.scale.least_speed),
                "chip": math.degrees(self.scale.chip_speed),
                "amplifier": math.degrees(self.scale.amplifier_speed),
            },
        }


def design_servo(plant: Plant, counts_per_radian: float, timer: int, name: str = "axis") -> ServoDesign:
    """Chapter 6.4 for one plant; raises CommandError where the design's gain does not fit into the byte."""
    scale = AxisScale(counts_per_radian, timer, plant, name)
    discrete = plant.at_timer(timer)
    controller = design_double_pole(discrete)
    try:
        registers = nearest_registers(controller, timer)
    except CommandError as error:
        raise CommandError(
            f"{name}: at {discrete.period * 1e3:.3f} ms the double pole needs K = {controller.gain:.1f}, the "
            f"register holds at most {255 / 4}: take a longer sample period ({error})"
        ) from None
    poles = closed_loop_poles(discrete, registers.filter)
    return ServoDesign(
        scale=scale,
        plant=plant,
        discrete=discrete,
        filter=controller,
        registers=registers,
        poles=(complex(poles[0]), complex(poles[1]), complex(poles[2])),
        margins=margins(discrete, registers.filter),
        uncompensated_limit=uncompensated_gain_limit(discrete),
        compensated_limit=compensated_gain_limit(discrete),
        breakaway=uncompensated_breakaway(discrete),
        velocity=velocity_bounds(discrete),
        velocity_register=design_velocity_register(plant, timer),
    )
