"""The quantised loop as chip, amplifier and motor close it, for many plants or filters at once.

The filter in time (docs/protocols): MC[n] = (K/4) X[n] − (A/256)(K/4) X[n−1] − (B/256) MC[n−1], truncated
toward zero, clamped to −128..127, the clamped value fed back; X is the difference of whole counts. Between
samples the motor moves exactly under the held DAC value; Coulomb friction is given in DAC counts. All
positions in counts.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from medusa.servo.plant import DAC_MAX, DAC_MIN, Plant
from medusa.servo.position_filter import FilterRegisters

Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


class MotorModel:
    """Motors under zero-order hold, exact between samples, with Coulomb friction in DAC counts.

    T_M dv/dt = C (u − f sign v) − v; at rest it stays while |u| ≤ f. All parameters broadcast to one shape.
    """

    def __init__(
        self,
        time_constant: ArrayLike,
        velocity_gain: ArrayLike,
        period: ArrayLike,
        *,
        friction: ArrayLike = 0.0,
        position: ArrayLike = 0.0,
        shape: tuple[int, ...] = (),
    ) -> None:
        arrays = (
            np.asarray(a, dtype=np.float64)
            for a in (time_constant, velocity_gain, period, friction, position)
        )
        tm, c, t, f, x, _ = np.broadcast_arrays(*arrays, np.empty(shape))
        self._tm, self._c, self._t, self._f = tm, c, t, f
        self._decay = np.exp(-t / tm)
        self._frictionless = not np.any(f)
        self.position: Floats = np.array(x)
        self.velocity: Floats = np.zeros_like(self.position)

    def advance(self, dac: NDArray[np.int64]) -> None:
        """One sample period under `dac` counts."""
        if self._frictionless:
            final: Floats = np.asarray(self._c * dac, dtype=np.float64)
            difference = self.velocity - final
            self.position = self.position + final * self._t + difference * self._tm * (1 - self._decay)
            self.velocity = final + difference * self._decay
            return
        moving = self.velocity != 0
        held = ~moving & (np.abs(dac) <= self._f)
        direction = np.where(moving, np.sign(self.velocity), np.sign(dac))
        final = np.where(held, 0.0, self._c * (dac - direction * self._f)).astype(np.float64)
        difference = self.velocity - final
        velocity = final + difference * self._decay
        stops = moving & (velocity * direction <= 0)
        self.position = np.where(
            stops, self.position, self.position + final * self._t + difference * self._tm * (1 - self._decay)
        )
        if np.any(stops):
            self._turn(stops, dac, final)
        self.velocity = np.where(stops, self.velocity, velocity)

    def _turn(self, stops: NDArray[np.bool_], dac: NDArray[np.int64], final: Floats) -> None:
        """Run to standstill within the sample, then on the other way if the DAC exceeds the friction."""
        with np.errstate(divide="ignore", invalid="ignore"):
            until = np.where(stops, self._tm * np.log((self.velocity - final) / -final), 0.0)
        until = np.clip(np.nan_to_num(until, nan=0.0, posinf=0.0), 0.0, self._t)
        stopped = (
            self.position
            + final * until
            + (self.velocity - final) * self._tm * (1 - np.exp(-until / self._tm))
        )
        rest = self._t - until
        onward = np.where(np.abs(dac) > self._f, self._c * (dac - np.sign(dac) * self._f), 0.0)
        left = np.exp(-rest / self._tm)
        self.position = np.where(stops, stopped + onward * (rest - self._tm * (1 - left)), self.position)
        self.velocity = np.where(stops, onward * (1 - left), self.velocity)


class FilterModel:
    """The chip's position filter on whole counts; registers broadcast to the batch's shape."""

    def __init__(
        self, zero: ArrayLike, pole: ArrayLike, gain: ArrayLike, before: tuple[int, int] = (0, 0)
    ) -> None:
        """`before`: error and DAC of the sample before the first, as entering control leaves them: 0."""
        self._zero, self._pole, self._gain = (np.asarray(r, dtype=np.int64) for r in (zero, pole, gain))
        self._error: Integers = np.asarray(before[0], dtype=np.int64)
        self._command: Integers = np.asarray(before[1], dtype=np.int64)

    def step(self, error: Integers) -> Integers:
        """DAC counts for an error in counts: integer arithmetic over the common denominator 1024."""
        numerator = (
            256 * self._gain * error - self._zero * self._gain * self._error - 4 * self._pole * self._command
        )
        truncated = np.sign(numerator) * (np.abs(numerator) // 1024)
        self._error = error
        self._command = np.clip(truncated, DAC_MIN, DAC_MAX)
        return self._command


@dataclass(frozen=True)
class LoopRecord:
    """What a loop did at its samples; arrays of shape (samples, …batch), positions in counts."""

    time: Floats
    command: Floats
    counts: Integers
    shaft: Floats
    dac: Integers
    """The command that is applied from this sample on."""

    @property
    def error(self) -> Floats:
        """Command minus actual, counts."""
        return self.command - self.counts


def simulate_position(
    plant: Plant,
    registers: FilterRegisters,
    command: Sequence[int] | Integers,
    *,
    friction: float = 0.0,
    start: float = 0.0,
    before: tuple[int, int] = (0, 0),
) -> LoopRecord:
    """One axis in position control under a command sequence (counts at each sample), starting at rest.

    `friction` in DAC counts, `start` in counts, `before` the error and DAC of the sample before. Shape
    (len(command),) throughout.
    """
    motor = MotorModel(
        plant.time_constant, plant.velocity_gain, registers.period, friction=friction, position=start
    )
    controller = FilterModel(registers.zero, registers.pole, registers.gain, before)
    targets = np.asarray(command, dtype=np.int64)
    return _run(motor, controller, targets, registers.period)


def simulate_batch(
    time_constant: ArrayLike,
    velocity_gain: ArrayLike,
    registers: tuple[ArrayLike, ArrayLike, ArrayLike],
    period: float,
    command: Sequence[int] | Integers,
    *,
    friction: ArrayLike = 0.0,
    start: ArrayLike = 0.0,
) -> LoopRecord:
    """One command through many plants and (A, B, K) at once; they broadcast. Shape (samples, …batch)."""
    shape = np.broadcast_shapes(
        *(np.shape(a) for a in (time_constant, velocity_gain, friction, start, *registers))
    )
    motor = MotorModel(time_constant, velocity_gain, period, friction=friction, position=start, shape=shape)
    return _run(motor, FilterModel(*registers), np.asarray(command, dtype=np.int64), period)


def _run(motor: MotorModel, controller: FilterModel, targets: Integers, period: float) -> LoopRecord:
    samples, shape = len(targets), motor.position.shape
    counts = np.empty((samples, *shape), dtype=np.int64)
    shaft = np.empty((samples, *shape))
    dac = np.empty((samples, *shape), dtype=np.int64)
    for n in range(samples):
        shaft[n] = motor.position
        counts[n] = np.floor(motor.position)
        dac[n] = controller.step(targets[n] - counts[n])
        motor.advance(dac[n])
    return LoopRecord(_times(samples, period), targets.astype(np.float64), counts, shaft, dac)


def _times(samples: int, period: float) -> Floats:
    return np.arange(samples, dtype=np.float64) * period


def simulate_proportional_velocity(
    plant: Plant,
    gain: int,
    velocity: Sequence[int] | Integers,
    period: float,
    *,
    friction: float = 0.0,
    start: float = 0.0,
) -> LoopRecord:
    """One axis in proportional velocity control: MC = sat((K/4)(vc − (x[n] − x[n−1]))).

    `gain` is register 22H, vc comes in 1/16 count/sample. The record's command is the integral of the
    commanded velocity, counts.
    """
    motor = MotorModel(plant.time_constant, plant.velocity_gain, period, friction=friction, position=start)
    wanted = np.asarray(velocity, dtype=np.int64)
    counts = np.empty(len(wanted), dtype=np.int64)
    shaft = np.empty(len(wanted))
    dac = np.empty(len(wanted), dtype=np.int64)
    before = np.floor(motor.position).astype(np.int64)
    for n, vc in enumerate(wanted):
        shaft[n] = motor.position
        now = np.floor(motor.position).astype(np.int64)
        numerator = gain * (vc - 16 * (now - before))
        dac[n] = np.clip(np.sign(numerator) * (np.abs(numerator) // 64), DAC_MIN, DAC_MAX)
        counts[n] = before = now
        motor.advance(dac[n])
    travelled = np.concatenate(([0.0], np.cumsum(wanted[:-1] / 16)))
    return LoopRecord(_times(len(wanted), period), travelled + start, counts, shaft, dac)


def simulate_linear(
    plant: Plant, zero: float, pole: float, gain: float, period: float, command: ArrayLike
) -> Floats:
    """The loop without quantisation or saturation (figure 6.7): shaft position at each sample."""
    targets = np.asarray(command, dtype=np.float64)
    out = np.empty(len(targets))
    position = velocity = error = drive = 0.0
    for n, target in enumerate(targets):
        out[n] = position
        drive = gain * (target - position) - gain * zero * error - pole * drive
        error = target - position
        position, velocity = plant.advance(position, velocity, drive, period)
    return out
