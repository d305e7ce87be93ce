"""UMBmark: the two systematic odometry errors of a differential drive from a square driven both ways.

After J. Borenstein and L. Feng, "Measurement and correction of systematic odometry errors in mobile robots",
IEEE Trans. Robotics and Automation 12 (1996). A wrong wheel base turns every corner too far by α, unequal
wheels bend every side by β. Driven counter-clockwise they act as α + β, clockwise as α − β: one way alone
cannot tell them apart, and a base whose two errors cancel in one direction looks good there.

Frame of a run: it starts at the origin, looks along +x and drives its first side that way. A closing error is
the true end pose minus the odometry's.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import cos, hypot, inf, isfinite, pi, sin, sqrt
from typing import Literal

from labmate.odometry import Odometry, OdometryNoise, Pose, WheelGeometry
from medusa.errors import CommandError

Direction = Literal["ccw", "cw"]
DIRECTIONS: tuple[Direction, Direction] = ("ccw", "cw")

EncoderTrack = Sequence[tuple[int, int]]
"""Left and right counts along a run, in order."""

_UNWEIGHTED = OdometryNoise(wheel=0.0, wheel_base=0.0, wheel_ratio=0.0)


@dataclass(frozen=True, slots=True)
class Closing:
    """True end position minus the odometry's, m, in the run's frame."""

    direction: Direction
    x: float
    y: float

    @property
    def distance(self) -> float:
        """Length of the closing error, m."""
        return hypot(self.x, self.y)


@dataclass(frozen=True, slots=True)
class Run:
    """One square as recorded: its direction, the encoders on the way, and where it truly ended."""

    direction: Direction
    track: EncoderTrack
    true_end: Pose


@dataclass(frozen=True, slots=True)
class Calibration:
    """Effective wheel base (m) and right/left diameter ratio, each with its standard deviation."""

    wheel_base: float
    wheel_ratio: float
    wheel_base_deviation: float
    wheel_ratio_deviation: float

    def geometry(self, counts_per_metre: float) -> WheelGeometry:
        """The wheels as calibrated."""
        return WheelGeometry(self.wheel_base, self.wheel_ratio, counts_per_metre)

    def noise(self, wheel: float) -> OdometryNoise:
        """The odometry's noise: `wheel` as in OdometryNoise, and what the calibration leaves open."""
        return OdometryNoise(wheel, self.wheel_base_deviation, self.wheel_ratio_deviation)


class CalibrationError(CommandError):
    """The closing errors cannot be those of a square driven both ways."""


def predict_closing(
    direction: Direction, side: float, nominal: WheelGeometry, true: WheelGeometry
) -> Closing:
    """Closing error of an uncalibrated square, exactly.

    The base counts `nominal`, its wheels do `true`. A side is the arc β = κ L, a corner turns by
    ±(b_n/b)(π/2) about a point (E_d − 1)/(E_d + 1) b/2 off the axle's middle: eight arcs. The odometry's own
    end is the origin, so the result is the true end position.
    """
    sign = 1.0 if direction == "ccw" else -1.0
    half_difference = (true.wheel_ratio - 1.0) / (true.wheel_ratio + 1.0)
    bend = side * true.drift
    quarter = sign * 0.5 * pi * nominal.wheel_base / true.wheel_base
    shift = sign * 0.25 * pi * nominal.wheel_base * half_difference
    x = y = heading = 0.0
    for _ in range(4):
        for way, turn in ((side, bend), (shift, quarter)):
            chord = way * (sin(0.5 * turn) / (0.5 * turn) if turn != 0.0 else 1.0)
            x += chord * cos(heading + 0.5 * turn)
            y += chord * sin(heading + 0.5 * turn)
            heading += turn
    return Closing(direction, x, y)


def estimate_closed_form(
    closings: Sequence[Closing], side: float, nominal: WheelGeometry, measured_deviation: float = 0.0
) -> Calibration:
    """Wheel base and ratio from the closing errors of squares of `side` m, to first order.

    With ε = α + β counter-clockwise and α − β clockwise, four sides and corners leave x = 2 L ε and
    y = ∓2 L ε, so that

        ε_ccw = (x̄ − ȳ)/(4 L),  ε_cw = (x̄ + ȳ)/(4 L),  α = (ε_ccw + ε_cw)/2,  β = (ε_ccw − ε_cw)/2
        b = b_n (π/2)/(π/2 + α),  R = L/β,  E_d = (R + b/2)/(R − b/2)

    x̄, ȳ: centre of the runs of one direction. `measured_deviation` (m) of one coordinate of one measured
    position goes into the deviations; with several runs a way their scatter does, if it is the larger.
    Raises CalibrationError when a direction is missing or the errors are too large to be a base's.
    """
    if not 0.0 < side < inf:
        raise CalibrationError(f"the square's side must be positive and finite, it is {side} m")
    skew: dict[Direction, float] = {}
    variance = 0.0
    for direction, sign in (("ccw", -1.0), ("cw", 1.0)):
        runs = [(c.x + sign * c.y) / (4.0 * side) for c in closings if c.direction == direction]
        if not runs:
            raise CalibrationError(
                f"no {direction} run: the two errors can only be told apart by driving both ways"
            )
        if not all(isfinite(value) for value in runs):
            raise CalibrationError(f"a {direction} closing error is not a finite number")
        mean = sum(runs) / len(runs)
        skew["ccw" if direction == "ccw" else "cw"] = mean
        # One coordinate's σ in (x ∓ y)/(4 L) is σ √2/(4 L).
        single = measured_deviation**2 * 2.0 / (4.0 * side) ** 2
        if len(runs) > 1:
            single = max(single, sum((value - mean) ** 2 for value in runs) / (len(runs) - 1))
        variance += single / len(runs)
    alpha, beta = 0.5 * (skew["ccw"] + skew["cw"]), 0.5 * (skew["ccw"] - skew["cw"])
    # A tenth of a radian at every corner or along every side is beyond any base that still drives squares
    # (20 cm of error a metre of side), and beyond the first order; it is a wrong unit or a wrong sign.
    for name, value, where in (("α", alpha, "at a corner"), ("β", beta, "along a side")):
        if abs(value) > 0.1:
            raise CalibrationError(
                f"the closing errors mean {name} = {value:.3g} rad {where}, more than 0.1: "
                "check their unit, their sign and the side's length"
            )
    wheel_base = nominal.wheel_base * 0.5 * pi / (0.5 * pi + alpha)
    bend = beta * wheel_base / (2.0 * side)
    deviation = 0.5 * sqrt(variance)
    return Calibration(
        wheel_base,
        (1.0 + bend) / (1.0 - bend),
        nominal.wheel_base * deviation / (0.5 * pi),
        deviation * wheel_base / side,
    )


def refine_on_tracks(runs: Sequence[Run], start: Calibration, counts_per_metre: float) -> Calibration:
    """Gauss–Newton on the recorded encoder tracks: no first order and no ideal square is left in the result.

    Minimises Σ ‖true end − odometry(b, E_d)‖² over the runs' positions, with the odometry's own
    sensitivities as the Jacobian. The deviations are those of `start`.
    """
    base, ratio = start.wheel_base, start.wheel_ratio
    for _ in range(10):
        bb = br = rr = gb = gr = 0.0
        for run in runs:
            end, (by_base, by_ratio) = reckon(run.track, WheelGeometry(base, ratio, counts_per_metre))
            for error, jb, jr in (
                (run.true_end.x - end.x, by_base[0], by_ratio[0]),
                (run.true_end.y - end.y, by_base[1], by_ratio[1]),
            ):
                bb, br, rr = bb + jb * jb, br + jb * jr, rr + jr * jr
                gb, gr = gb + jb * error, gr + jr * error
        determinant = bb * rr - br * br
        if not determinant > 1e-9 * bb * rr:
            raise CalibrationError("these runs cannot tell wheel base and wheel ratio apart; drive both ways")
        step_base, step_ratio = (rr * gb - br * gr) / determinant, (bb * gr - br * gb) / determinant
        base, ratio = base + step_base, ratio + step_ratio
        if abs(step_base) < 1e-9 and abs(step_ratio) < 1e-10:
            return Calibration(base, ratio, start.wheel_base_deviation, start.wheel_ratio_deviation)
    raise CalibrationError(
        "the fit to the recorded runs did not settle; are the true end poses of these runs?"
    )


def reckon(
    track: EncoderTrack, geometry: WheelGeometry
) -> tuple[Pose, tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """End pose of a track from the origin, and its sensitivities to wheel base and ratio."""
    odometry = Odometry(geometry, _UNWEIGHTED)
    for left, right in track:
        odometry.step(left, right)
    return odometry.pose, odometry.sensitivity


def closing_of(run: Run, geometry: WheelGeometry) -> Closing:
    """Closing error of a recorded run under some geometry."""
    end, _ = reckon(run.track, geometry)
    return Closing(run.direction, run.true_end.x - end.x, run.true_end.y - end.y)
