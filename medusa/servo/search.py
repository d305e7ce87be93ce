"""The best filter over the bytes A, B, K and T, on the quantised loop instead of the linear one.

The thesis cancels the plant's pole and so leaves a pole near p that every saturated step wakes: its tail takes
T_M to die. It also rounds a gain to the nearest quarter after the design. Here the bytes themselves are tried,
with the 8-bit truncating DAC and whole counts, on the plant and on eight more with T_M and C up to 20 % off.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medusa.errors import CommandError
from medusa.servo.loop import simulate_batch
from medusa.servo.margins import grid_margins
from medusa.servo.plant import DAC_MAX, Plant
from medusa.servo.position_filter import FilterRegisters, dead_band, design_double_pole, nearest_registers
from medusa.servo.response import settled_from
from medusa.servo.sampling import sample_period

Bytes = NDArray[np.int64]
"""Filters, shape (n, 3): A, B, K."""
STEPS = (100, 30, 1000, 10_000)
SCORED = (100, 1000)
PLACES = (0.0, 0.5)
"""Where between two encoder counts the shaft starts: the response of a small step depends on it."""


@dataclass(frozen=True)
class Criterion:
    """What a filter must do, and by what the best is chosen (docs/servo).

    Required: margins; no step from 100 counts on worse than the thesis's bytes in settling, no wider dead band;
    no overshoot of the counts beyond `overshoot` or theirs, `small_overshoot` below 100 counts; on the plants
    that are off, it stays within 2 % or `small_overshoot` and comes to rest.
    Chosen: the least worst 2 % settling of 100 plus 1000 counts over the nine plants; of those within 5 % the
    least dead band.
    """

    gain_margin: float = 2.5
    phase_margin_deg: float = 50.0
    overshoot: int = 0
    small_overshoot: int = 3
    uncertainty: float = 0.2

    def plants(self, plant: Plant) -> list[Plant]:
        """The nominal plant first, then the eight with T_M and C off by the uncertainty."""
        factors = (1.0, 1 - self.uncertainty, 1 + self.uncertainty)
        return [plant.scaled(t, c) for t in factors for c in factors]


@dataclass(frozen=True)
class StepQuality:
    """Worst over both directions and the places between counts; shape (n,) each."""

    settling: NDArray[np.float64]
    """s; infinite where the shaft does not stay within 2 % (one count for steps below 50)."""
    overshoot: NDArray[np.int64]
    """Of the counts the board reports, beyond the command."""


@dataclass(frozen=True)
class Candidate:
    """One filter with its figures on the plant it was searched for."""

    registers: FilterRegisters
    settling: dict[int, float]
    """Worst 2 % settling in s on the nominal plant, by step in counts."""
    overshoot: dict[int, int]
    robust_settling: dict[int, float]
    """The same over all nine plants, for the steps that are scored."""
    dead_band: float

    @property
    def score(self) -> float:
        """Sum of the robust settling times, s."""
        return sum(self.robust_settling.values())


def step_quality(plant: Plant, filters: Bytes, timer: int, step: int) -> StepQuality:
    """Run a step in both directions through the quantised loop of every filter."""
    period = sample_period(timer)
    samples = round((12 * plant.time_constant + 1.3 * step / (plant.velocity_gain * DAC_MAX)) / period) + 20
    a, b, k = (filters[:, i, None] for i in range(3))
    places = np.asarray(PLACES)[None, :]
    settling = np.zeros(len(filters))
    overshoot = np.full(len(filters), -step)
    for way in (step, -step):
        run = simulate_batch(
            plant.time_constant, plant.velocity_gain, (a, b, k), period, [way] * samples, start=places
        )
        band = max(0.02 * step, 1.0)
        first = settled_from(np.abs(run.shaft - run.shaft[0] - way) <= band)
        times = np.where(first < samples, first * period, np.inf)
        settling = np.maximum(settling, times.max(axis=1))
        beyond = ((run.counts - way) * np.sign(way)).max(axis=(0, 2))
        overshoot = np.maximum(overshoot, beyond)
    return StepQuality(settling, overshoot)


def assess(plant: Plant, registers: FilterRegisters, criterion: Criterion | None = None) -> Candidate:
    """The figures of one filter, by the same runs as the search's."""
    criterion = criterion or Criterion()
    filters = np.array([[registers.zero, registers.pole, registers.gain]])
    qualities = {step: step_quality(plant, filters, registers.timer, step) for step in STEPS}
    robust = {
        step: max(
            float(step_quality(p, filters, registers.timer, step).settling[0])
            for p in criterion.plants(plant)
        )
        for step in SCORED
    }
    return Candidate(
        registers,
        {step: float(q.settling[0]) for step, q in qualities.items()},
        {step: int(max(q.overshoot[0], 0)) for step, q in qualities.items()},
        robust,
        dead_band(registers.filter),
    )


def thesis_registers(plant: Plant, timer: int) -> FilterRegisters:
    """The bytes nearest to the thesis's design for this plant at this sample period."""
    return nearest_registers(design_double_pole(plant.at_timer(timer)), timer)


def search_filter(plant: Plant, timer: int, criterion: Criterion | None = None) -> Candidate:
    """The best bytes A, B, K at one sample timer; CommandError when none meets the criterion.

    A coarse grid of the bytes that have the margins, then every byte about the best of them.
    """
    criterion = criterion or Criterion()
    reference = _reference(plant, timer, criterion)
    coarse = _with_margins(plant, timer, _grid(plant, timer), criterion)
    best = _rank(plant, timer, coarse, criterion, reference)
    if not best:
        raise CommandError(
            f"no filter at {sample_period(timer) * 1e3:.3f} ms has margins of {criterion.gain_margin:g} and "
            f"{criterion.phase_margin_deg:g}° and is nowhere worse than the thesis's: keep that one"
        )
    around = _around([candidate.registers for candidate in best[:3]])
    fine = _rank(plant, timer, _with_margins(plant, timer, around, criterion), criterion, reference)
    return _choose(best + fine)


def search_timers(
    plant: Plant, timers: Iterable[int], criterion: Criterion | None = None
) -> dict[int, Candidate]:
    """The best filter at each sample timer that has one."""
    found: dict[int, Candidate] = {}
    for timer in timers:
        try:
            found[timer] = search_filter(plant, timer, criterion)
        except CommandError:
            continue
    return found


def best_timer(found: dict[int, Candidate]) -> int:
    """The timer of the best candidate; of those within 5 % of the least score the least dead band."""
    if not found:
        raise CommandError("no sample timer has a filter that meets the criterion")
    chosen = _choose(list(found.values()))
    return chosen.registers.timer


def _choose(candidates: Sequence[Candidate]) -> Candidate:
    least = min(candidate.score for candidate in candidates)
    near = [candidate for candidate in candidates if candidate.score <= 1.05 * least]
    return min(near, key=lambda candidate: (candidate.dead_band, candidate.score))


def _reference(plant: Plant, timer: int, criterion: Criterion) -> Candidate | None:
    try:
        return assess(plant, thesis_registers(plant, timer), criterion)
    except CommandError:  # its gain does not fit into the byte at very short sample periods
        return None


def _grid(plant: Plant, timer: int) -> Bytes:
    """Zeros from 1/2 on, poles to −5/8, gains to where the loop gain at p reaches the stability limit."""
    discrete = plant.at_timer(timer)
    top = min(255.0, 4 / (discrete.gain * discrete.zero))
    gains = np.unique(np.geomspace(2, top, 30).round().astype(np.int64))
    mesh = np.meshgrid(np.arange(128, 255, 3), np.arange(0, 161, 8), gains, indexing="ij")
    return np.stack([axis.ravel() for axis in mesh], axis=1)


def _around(centres: Sequence[FilterRegisters]) -> Bytes:
    offsets = np.meshgrid([-3, -2, -1, 0, 1, 2, 3], [-8, -4, 0, 4, 8], [-2, -1, 0, 1, 2], indexing="ij")
    shifts = np.stack([axis.ravel() for axis in offsets], axis=1)
    every = np.concatenate([shifts + np.array([c.zero, c.pole, c.gain]) for c in centres])
    return np.unique(every[((every >= [0, 0, 1]) & (every <= 255)).all(axis=1)], axis=0)


def _with_margins(plant: Plant, timer: int, filters: Bytes, criterion: Criterion) -> Bytes:
    gain, phase = grid_margins(
        plant.at_timer(timer), filters[:, 0] / 256, filters[:, 1] / 256, filters[:, 2] / 4
    )
    return filters[
        (gain >= criterion.gain_margin) & (phase >= criterion.phase_margin_deg) & np.isfinite(phase)
    ]


def _registers(row: Bytes, timer: int) -> FilterRegisters:
    zero, pole, gain = (int(value) for value in row)
    return FilterRegisters(zero, pole, gain, timer)


def _rank(
    plant: Plant,
    timer: int,
    filters: Bytes,
    criterion: Criterion,
    reference: Candidate | None,
    keep: int = 60,
) -> list[Candidate]:
    """Candidates that pass on the nominal plant, the `keep` best of them tried on all nine; best first."""
    settling: dict[int, NDArray[np.float64]] = {}
    overshoot: dict[int, NDArray[np.int64]] = {}
    static = filters[:, 2] / 4 * (1 - filters[:, 0] / 256) / (1 + filters[:, 1] / 256)
    if reference is not None:
        filters = filters[1 / static <= reference.dead_band + 1e-12]
    for step in STEPS:
        quality = step_quality(plant, filters, timer, step)
        allowed, limit = criterion.small_overshoot, np.inf
        if step >= 100:
            allowed = criterion.overshoot
            if reference is not None:
                allowed = max(allowed, reference.overshoot[step])
                limit = reference.settling[step] + 1e-9
        passed = (quality.overshoot <= allowed) & np.isfinite(quality.settling) & (quality.settling <= limit)
        filters = filters[passed]
        settling = {s: v[passed] for s, v in settling.items()} | {step: quality.settling[passed]}
        overshoot = {s: v[passed] for s, v in overshoot.items()} | {step: quality.overshoot[passed]}
    order = np.argsort(np.sum([settling[s] for s in SCORED], axis=0), kind="stable")[:keep]
    filters = filters[order]
    robust = {step: np.zeros(len(filters)) for step in SCORED}
    steady = np.ones(len(filters), dtype=np.bool_)
    for off in criterion.plants(plant):
        for step in SCORED:
            quality = step_quality(off, filters, timer, step)
            robust[step] = np.maximum(robust[step], quality.settling)
            steady &= quality.overshoot <= max(criterion.small_overshoot, 0.02 * step)
    found = [
        Candidate(
            _registers(filters[i], timer),
            {step: float(settling[step][order[i]]) for step in STEPS},
            {step: int(max(overshoot[step][order[i]], 0)) for step in STEPS},
            {step: float(robust[step][i]) for step in SCORED},
            dead_band(_registers(filters[i], timer).filter),
        )
        for i in range(len(filters))
        if steady[i] and all(np.isfinite(robust[step][i]) for step in SCORED)
    ]
    return sorted(found, key=lambda candidate: candidate.score)
