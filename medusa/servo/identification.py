"""Estimating T_M, C and friction from open-loop pulses: the joint's answer to a held DAC value from rest.

From rest under u > 0 with Coulomb friction f (DAC counts), v∞ = C (u − f):

    x(t) = x₀ + v∞ (τ − T_M (1 − e^(−τ/T_M))),   τ = t − t_on,

and after the pulse the speed runs out toward −C f and stays at zero: both thesis (6.2) with the equation of
`plant`. When each pulse really began and ended on the board is not known to the host; the times are estimated
with the rest, bracketed by the samples that first show the new DAC value.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medusa.errors import CommandError
from medusa.servo.plant import Plant

Floats = NDArray[np.float64]
COUNT_VARIANCE = 1 / 12
"""Of an encoder that shows whole counts; the floor's half count of bias is taken up by x₀."""
_ITERATIONS = 60


@dataclass(frozen=True)
class Pulse:
    """One open-loop pulse from rest to rest as the board showed it; shapes (n,), time in s, positions in counts."""

    dac: int
    time: Floats
    counts: Floats
    shown_dac: NDArray[np.int64]
    """The DAC value in each snapshot."""

    def __post_init__(self) -> None:
        if self.dac == 0:
            raise ValueError("a pulse of 0 DAC counts moves nothing")
        if not len(self.time) == len(self.counts) == len(self.shown_dac):
            raise ValueError("time, counts and shown_dac of a pulse must be of one length")

    @property
    def weights(self) -> Floats:
        """Weight of each sample: those of one standstill show one and the same rounding, and count as one."""
        edges = np.flatnonzero(np.diff(self.counts) != 0) + 1
        lengths = np.diff(np.concatenate(([0], edges, [len(self.counts)])))
        return np.repeat(1 / np.sqrt(lengths), lengths)

    @property
    def on_bracket(self) -> tuple[float, float]:
        """(latest sample before, earliest sample with) the pulse."""
        first = int(np.argmax(self.shown_dac == self.dac))
        if self.shown_dac[first] != self.dac or first == 0:
            raise CommandError(f"a pulse of {self.dac} DAC counts shows no beginning")
        return float(self.time[first - 1]), float(self.time[first])

    @property
    def off_bracket(self) -> tuple[float, float]:
        """(latest sample with, earliest sample after) the pulse."""
        last = len(self.shown_dac) - 1 - int(np.argmax(self.shown_dac[::-1] == self.dac))
        if last == len(self.shown_dac) - 1:
            raise CommandError(f"a pulse of {self.dac} DAC counts shows no end")
        return float(self.time[last]), float(self.time[last + 1])


@dataclass(frozen=True)
class DirectionEstimate:
    """Gain and friction that the pulses of one direction of the counts give."""

    velocity_gain: float
    friction_dac: float
    velocity_gain_error: float
    friction_error: float


@dataclass(frozen=True)
class Identification:
    """A joint's plant with twice its standard deviation, and how far the directions differ."""

    plant: Plant
    time_constant_error: float
    velocity_gain_error: float
    """Two standard deviations, in s and counts/s per DAC count."""
    forward: DirectionEstimate
    backward: DirectionEstimate
    residual_counts: float
    """Root mean square of what the model leaves; 0.29 is the encoder's own."""
    pulses: int
    samples: int

    @property
    def asymmetry(self) -> float:
        """(C₊ − C₋)/C: how much more the joint moves for a positive DAC count than for a negative one."""
        return (self.forward.velocity_gain - self.backward.velocity_gain) / self.plant.velocity_gain

    @property
    def friction_dac(self) -> float:
        """Mean Coulomb friction of both directions, DAC counts."""
        return (self.forward.friction_dac + self.backward.friction_dac) / 2


def pulse_position(
    time: Floats, dac: float, time_constant: float, gain: float, friction: float, on: float, off: float
) -> Floats:
    """Counts gone at `time` through a pulse from rest; shape as `time`. Friction in DAC counts, at least 0."""
    sign = math.copysign(1.0, dac)
    final = gain * max(abs(dac) - friction, 0.0)
    driven = np.clip(time - on, 0.0, off - on)
    position = final * (driven - time_constant * (1 - np.exp(-driven / time_constant)))
    speed = final * (1 - math.exp(-(off - on) / time_constant))
    drag = gain * friction
    after = np.maximum(time - off, 0.0)
    if drag > 0:
        after = np.minimum(after, time_constant * math.log1p(speed / drag))
    position = position - drag * after + (speed + drag) * time_constant * (1 - np.exp(-after / time_constant))
    return np.asarray(sign * position, dtype=np.float64)


def estimate_plant(pulses: Sequence[Pulse]) -> Identification:
    """Least squares over all pulses for T_M, and C and friction of each direction.

    Levenberg–Marquardt; the pulse times and starting positions are unknowns, too. Raises CommandError when the
    pulses do not separate friction from gain (two sizes are needed each way) or did not move the joint.
    """
    for sign, name in ((1, "positive"), (-1, "negative")):
        sizes = {abs(p.dac) for p in pulses if p.dac * sign > 0}
        if len(sizes) < 2:
            raise CommandError(
                f"friction and gain cannot be separated: {len(sizes)} size(s) of {name} pulses, 2 are needed"
            )
    problem = _Problem(pulses)
    theta, covariance, residuals = problem.solve()
    deviation = 2 * np.sqrt(np.diag(covariance))
    forward = DirectionEstimate(theta[1], theta[3], deviation[1], deviation[3])
    backward = DirectionEstimate(theta[2], theta[4], deviation[2], deviation[4])
    mean_gain_variance = (covariance[1, 1] + covariance[2, 2] + 2 * covariance[1, 2]) / 4
    return Identification(
        plant=Plant(float(theta[0]), float((theta[1] + theta[2]) / 2)),
        time_constant_error=float(deviation[0]),
        velocity_gain_error=float(2 * math.sqrt(mean_gain_variance)),
        forward=_floats(forward),
        backward=_floats(backward),
        residual_counts=float(np.sqrt(residuals @ residuals / problem.looks)),
        pulses=len(pulses),
        samples=round(problem.looks),
    )


def _floats(estimate: DirectionEstimate) -> DirectionEstimate:
    return DirectionEstimate(
        float(estimate.velocity_gain),
        float(estimate.friction_dac),
        float(estimate.velocity_gain_error),
        float(estimate.friction_error),
    )


class _Problem:
    """θ = (T_M, C₊, C₋, f₊, f₋, then t_on, t_off, x₀ of each pulse)."""

    def __init__(self, pulses: Sequence[Pulse]) -> None:
        self.pulses = pulses
        self.weights = [pulse.weights for pulse in pulses]
        self.looks = float(sum((weights**2).sum() for weights in self.weights))
        """How many independent samples there are."""
        start, lower, upper = [0.015], [5e-4], [0.5]
        for sign in (1, -1):
            gain = _rough_gain([p for p in pulses if p.dac * sign > 0])
            start.append(gain)
            lower.append(gain / 20)
            upper.append(gain * 20)
        least = min(abs(p.dac) for p in pulses)
        start += [0.05, 0.05]
        lower += [0.0, 0.0]
        upper += [0.98 * least, 0.98 * least]
        self.scale = [1e-3, start[1] * 1e-2, start[2] * 1e-2, 0.1, 0.1]
        for pulse in pulses:
            on, off = pulse.on_bracket, pulse.off_bracket
            origin = float(pulse.counts[0])
            start += [sum(on) / 2, sum(off) / 2, origin + 0.5]
            lower += [on[0], off[0], origin - 3]
            upper += [on[1], off[1], origin + 3]
            self.scale += [1e-4, 1e-4, 0.1]
        self.start, self.lower, self.upper = (np.asarray(x, dtype=np.float64) for x in (start, lower, upper))

    def residuals(self, theta: Floats) -> Floats:
        """Weighted, counts. Shape (samples,)."""
        parts = []
        for i, pulse in enumerate(self.pulses):
            on, off, origin = theta[5 + 3 * i : 8 + 3 * i]
            way = 0 if pulse.dac > 0 else 1
            gone = pulse_position(pulse.time, pulse.dac, theta[0], theta[1 + way], theta[3 + way], on, off)
            parts.append(self.weights[i] * (pulse.counts + 0.5 - origin - gone))
        return np.concatenate(parts)

    def jacobian(self, theta: Floats) -> Floats:
        """Of the residuals, by central differences of 1 % of each unknown's scale. Shape (samples, unknowns)."""
        columns = []
        for i, step in enumerate(np.asarray(self.scale) * 1e-2):
            up, down = theta.copy(), theta.copy()
            up[i] = theta[i] + step
            down[i] = max(theta[i] - step, 0.0) if i in (3, 4) else theta[i] - step
            columns.append((self.residuals(up) - self.residuals(down)) / (up[i] - down[i]))
        return np.stack(columns, axis=1)

    def solve(self) -> tuple[Floats, Floats, Floats]:
        """(θ, its covariance, residuals) at the least squares."""
        theta, damping = self.start, 1e-2
        residuals = self.residuals(theta)
        cost = float(residuals @ residuals)
        for _ in range(_ITERATIONS):
            jacobian = self.jacobian(theta)
            normal = jacobian.T @ jacobian
            gradient = jacobian.T @ residuals
            # An unknown held at its bound stays there while the gradient pushes it outward.
            held = ((theta <= self.lower) & (gradient > 0)) | ((theta >= self.upper) & (gradient < 0))
            part = np.ix_(~held, ~held)
            improved = False
            while damping < 1e8:
                step = np.zeros_like(theta)
                damped = normal[part] + damping * np.diag(np.diag(normal)[~held] + 1e-12)
                step[~held] = np.linalg.solve(damped, -gradient[~held])
                trial = np.clip(theta + step, self.lower, self.upper)
                after = self.residuals(trial)
                if float(after @ after) < cost:
                    improved = True
                    break
                damping *= 4
            if not improved:
                break
            settled = cost - float(after @ after) < 1e-7 * cost
            theta, residuals, cost = trial, after, float(after @ after)
            damping = max(damping / 10, 1e-9)
            if settled:
                break
        return theta, self._covariance(theta, residuals), residuals

    def _covariance(self, theta: Floats, residuals: Floats) -> Floats:
        """σ² (JᵀJ)⁻¹ over the unknowns that are not held at a bound, σ² at least the encoder's."""
        free = (theta > self.lower) & (theta < self.upper)
        jacobian = self.jacobian(theta)[:, free]
        spare = max(self.looks - int(free.sum()), 1.0)
        variance = max(float(residuals @ residuals) / spare, COUNT_VARIANCE)
        covariance = np.zeros((len(theta), len(theta)))
        covariance[np.ix_(free, free)] = variance * np.linalg.pinv(jacobian.T @ jacobian)
        return covariance


def _rough_gain(pulses: Sequence[Pulse]) -> float:
    """C from way over DAC times time: a pulse from rest to rest goes C u d, whatever T_M."""
    ratios = [
        abs(p.counts[-1] - p.counts[0]) / (abs(p.dac) * (sum(p.off_bracket) - sum(p.on_bracket)) / 2)
        for p in pulses
    ]
    gain = float(np.median(ratios))
    if gain <= 0:
        raise CommandError(
            f"the joint did not move for {', '.join(str(p.dac) for p in pulses)} DAC counts: no power, a stuck "
            "joint, or more friction than that"
        )
    return gain
