"""What chapter 6 of the thesis prints about Medusa's three kinds of joint, and nothing derived from it.

The printed pole and gain of (6.8)–(6.10) are the reference model; the printed zero is never used, because the
pole determines it (0.96, 0.95 and 0.92 are its roundings).
"""

import math
from dataclasses import dataclass

from medusa.servo.plant import Plant
from medusa.servo.position_filter import Filter

PERIOD = 2.048e-3
"""The sample period chosen in 6.4.1, s."""


RESISTANCE = 4.0
"""Joint-referred armature resistance of the emulated power stage, Ω; the thesis prints none."""


@dataclass(frozen=True)
class PhysicalConstants:
    """Joint-referred motor, load, encoder and amplifier: R [Ω], J [kg m²], K_E [V s/rad], K_T [N m/A], E, K_A."""

    resistance: float
    inertia: float
    back_emf: float
    torque: float
    encoder: float
    amplifier: float

    @property
    def plant(self) -> Plant:
        """T_M = R J/(K_E K_T) and C = K_D K_A E/K_E, thesis (6.5) and (6.2)–(6.7)."""
        return Plant.from_constants(
            self.resistance, self.inertia, self.back_emf, self.torque, self.encoder, self.amplifier
        )


@dataclass(frozen=True)
class ThesisJoint:
    """One column of tables 6.1–6.3 with its printed plant and controller."""

    name: str
    printed_gain: float
    printed_pole: float
    printed_zero: float
    printed_filter: Filter
    amplifier_gain: float
    resolution_deg: float
    profile_speed: float
    profile_acceleration: float
    printed_velocity_gains: tuple[float, float, float]
    printed_least_speed_deg: float

    @property
    def plant(self) -> Plant:
        """T_M and C of the printed pole and gain at 2.048 ms."""
        return Plant.from_discrete(self.printed_gain, self.printed_pole, PERIOD)

    @property
    def constants(self) -> PhysicalConstants:
        """Joint-referred constants that give this plant: R of the power stage, K_T = K_E, J = T_M K_E K_T/R."""
        back_emf = self.plant.back_emf(self.counts_per_radian, self.amplifier_gain)
        return PhysicalConstants(
            resistance=RESISTANCE,
            inertia=self.plant.inertia(RESISTANCE, back_emf, back_emf),
            back_emf=back_emf,
            torque=back_emf,
            encoder=self.counts_per_radian,
            amplifier=self.amplifier_gain,
        )

    @property
    def counts_per_radian(self) -> float:
        """E from the printed resolution of table 6.1."""
        return math.degrees(1.0) / self.resolution_deg

    @property
    def counts_per_degree(self) -> float:
        """E in counts per degree of the joint."""
        return 1.0 / self.resolution_deg


VERGENCE = ThesisJoint(
    "vergence", 0.155, 0.88, 0.96, Filter(0.88, 0.0, 1.14), 1.0, 0.0031, 1.5 * math.pi, 6 * math.pi,
    (6.2, 3.5, 2.9), 1.55,
)  # fmt: skip
TILT = ThesisJoint(
    "tilt", 0.149, 0.86, 0.95, Filter(0.86, 0.0, 1.20), 1.95, 0.0018, 0.75 * math.pi, 3 * math.pi,
    (6.4, 4.3, 3.0), 0.9,
)  # fmt: skip
PAN = ThesisJoint(
    "pan", 0.106, 0.77, 0.92, Filter(0.77, 0.0, 1.71), 3.56, 0.0036, 1.5 * math.pi, 6 * math.pi,
    (8.7, 10.2, 3.8), 1.8,
)  # fmt: skip

JOINTS = {joint.name: joint for joint in (VERGENCE, TILT, PAN)}
AXES = {"pan": PAN, "tilt": TILT, "left_vergence": VERGENCE, "right_vergence": VERGENCE}
"""The head's four axes by the name the drivers use."""
INTEGRAL_ACCELERATION = 1.3 * math.pi
"""Acceleration of the integral velocity mode, 6.4.3, rad/s²."""
DESIGN_SPEED_DEG = 180.0
"""Greatest speed of table 6.1, degrees/s."""
