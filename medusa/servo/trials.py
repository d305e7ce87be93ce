"""Filters tried by steps on the quantised loop: settling and overshoot, on the plant and on plants that are off.

A small step's response depends on where between two counts the shaft starts and on its direction, so every step
is run from several places both ways.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medusa.servo.loop import simulate_batch
from medusa.servo.plant import DAC_MAX, Plant
from medusa.servo.position_filter import FilterRegisters, dead_band, design_double_pole, nearest_registers
from medusa.servo.response import settled_from
from medusa.servo.sampling import sample_period

Bytes = NDArray[np.int64]
"""Filters, shape (n, 3): A, B, K."""
STEPS = (100, 30, 1000, 10_000)
SCORED = (100, 1000)
PLACES = (0.0, 0.25, 0.5, 0.75)
"""Where between two encoder counts the shaft starts."""
UNCERTAINTY = 0.2


@dataclass(frozen=True)
class StepQuality:
    """One step in both directions from every place, for n filters."""

    settling: NDArray[np.float64]
    """s, shape (n, runs); infinite where the shaft does not stay in the band."""
    overshoot: NDArray[np.int64]
    """Of the counts that the board reports, beyond the command, worst of the runs; shape (n,)."""

    def of(self, chosen: NDArray[np.bool_] | NDArray[np.intp]) -> StepQuality:
        """The same for some of the filters."""
        return StepQuality(self.settling[chosen], self.overshoot[chosen])


@dataclass(frozen=True)
class Robustness:
    """Over several plants: mean settling (s) and worst overshoot (counts) by step, shape (n,) each."""

    settling: dict[int, NDArray[np.float64]]
    overshoot: dict[int, NDArray[np.int64]]


@dataclass(frozen=True)
class Candidate:
    """One filter with its figures on the plant it is meant for; by step in counts."""

    registers: FilterRegisters
    settling: dict[int, float]
    """Worst 2 % settling, s; of steps below 50 counts to one count."""
    median_settling: dict[int, float]
    overshoot: dict[int, int]
    robust_settling: dict[int, float]
    """Mean over the plants that may be, to within 2 % or the thesis's dead band, s."""
    robust_overshoot: dict[int, int]
    """Worst over the plants that may be."""
    dead_band: float

    @property
    def score(self) -> float:
        """Sum of the robust settling times, s."""
        return sum(self.robust_settling.values())


def plants_about(plant: Plant, uncertainty: float = UNCERTAINTY) -> list[Plant]:
    """The nominal plant first, then eight with T_M and C off by the uncertainty."""
    factors = (1.0, 1 - uncertainty, 1 + uncertainty)
    return [plant.scaled(t, c) for t in factors for c in factors]


def step_quality(
    plant: Plant,
    filters: Bytes,
    timer: int,
    step: int,
    band: float | None = None,
    places: Sequence[float] = PLACES,
) -> StepQuality:
    """Run a step through the quantised loop of every filter; `band` in counts, 2 % (or one count) when None."""
    period = sample_period(timer)
    samples = round((12 * plant.time_constant + 1.3 * step / (plant.velocity_gain * DAC_MAX)) / period) + 20
    band = max(0.02 * step, 1.0) if band is None else band
    a, b, k = (filters[:, i, None] for i in range(3))
    settling, overshoot = [], []
    for way in (step, -step):
        run = simulate_batch(
            plant.time_constant,
            plant.velocity_gain,
            (a, b, k),
            period,
            [way] * samples,
            start=np.asarray(places)[None, :],
        )
        first = settled_from(np.abs(run.shaft - run.shaft[0] - way) <= band)
        settling.append(np.where(first < samples, first * period, np.inf))
        overshoot.append(((run.counts - way) * np.sign(way)).max(axis=(0, 2)))
    return StepQuality(np.concatenate(settling, axis=1), np.maximum(*overshoot))


def robustness(plants: Sequence[Plant], filters: Bytes, timer: int, band: float) -> Robustness:
    """The scored steps on several plants; settled within 2 % or `band` counts."""
    settling: dict[int, NDArray[np.float64]] = {}
    overshoot: dict[int, NDArray[np.int64]] = {}
    for step in SCORED:
        runs = [step_quality(off, filters, timer, step, max(0.02 * step, band)) for off in plants]
        settling[step] = np.mean([run.settling.mean(axis=1) for run in runs], axis=0)
        overshoot[step] = np.max([run.overshoot for run in runs], axis=0)
    return Robustness(settling, overshoot)


def make_candidate(
    registers: FilterRegisters, qualities: dict[int, StepQuality], robust: Robustness, i: int
) -> Candidate:
    """The i-th of the filters tried."""
    return Candidate(
        registers,
        {step: float(q.settling[i].max()) for step, q in qualities.items()},
        {step: float(np.median(q.settling[i])) for step, q in qualities.items()},
        {step: int(max(q.overshoot[i], 0)) for step, q in qualities.items()},
        {step: float(times[i]) for step, times in robust.settling.items()},
        {step: int(counts[i]) for step, counts in robust.overshoot.items()},
        dead_band(registers.filter),
    )


def assess(
    plant: Plant, registers: FilterRegisters, *, uncertainty: float = UNCERTAINTY, band: float | None = None
) -> Candidate:
    """The figures of one filter, by the same runs as the search's; `band`: its own dead band when None."""
    filters = np.array([[registers.zero, registers.pole, registers.gain]])
    qualities = {step: step_quality(plant, filters, registers.timer, step) for step in STEPS}
    own = dead_band(registers.filter)
    robust = robustness(
        plants_about(plant, uncertainty), filters, registers.timer, own if band is None else band
    )
    return make_candidate(registers, qualities, robust, 0)


def thesis_registers(plant: Plant, timer: int) -> FilterRegisters:
    """The bytes nearest to the thesis's design for this plant at this sample period."""
    return nearest_registers(design_double_pole(plant.at_timer(timer)), timer)
