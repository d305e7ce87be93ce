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
from medusa.servo.margins import grid_margins
from medusa.servo.plant import Plant
from medusa.servo.position_filter import FilterRegisters
from medusa.servo.sampling import sample_period
from medusa.servo.trials import (
    PLACES,
    SCORED,
    STEPS,
    UNCERTAINTY,
    Bytes,
    Candidate,
    StepQuality,
    assess,
    make_candidate,
    plants_about,
    robustness,
    step_quality,
    thesis_registers,
)

MANY_PLACES = tuple(i / 16 for i in range(16))
COMPARED = (100, 1000, 10_000)
"""Steps that may nowhere be worse than with the thesis's bytes, counts."""


@dataclass(frozen=True)
class Criterion:
    """What a filter must do, and by what the best is chosen (docs/servo).

    Required: the margins. In steps of 100, 1000 and 10 000 counts, over both directions and four places between two
    counts, median and worst 2 % settling no later than with the thesis's bytes, no overshoot of the counts beyond
    theirs, no wider dead band. In steps of 30 counts an overshoot of at most `small_overshoot`. On eight plants off
    by the uncertainty it comes to rest, with an overshoot of at most that, 2 % or what the thesis's bytes have there.
    Chosen: the least mean settling of 100 plus 1000 counts over the nine plants, to within 2 % or the thesis's dead
    band; of those within 5 % the least dead band.
    """

    gain_margin: float = 2.5
    phase_margin_deg: float = 50.0
    small_overshoot: int = 3
    uncertainty: float = UNCERTAINTY


def search_filter(plant: Plant, timer: int, criterion: Criterion | None = None) -> Candidate:
    """The best bytes A, B, K at one sample timer; raises CommandError when none meets the criterion.

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
        return assess(plant, thesis_registers(plant, timer), uncertainty=criterion.uncertainty)
    except CommandError:  # its gain does not fit into the byte at very short sample periods
        return None


def _grid(plant: Plant, timer: int) -> Bytes:
    """Zeros from 1/2 on, poles to −5/8, gains to where the loop gain at p reaches the stability limit."""
    discrete = plant.at_timer(timer)
    top = min(255.0, 4 / (discrete.gain * discrete.zero))
    gains = np.unique(np.geomspace(2, top, 32).round().astype(np.int64))
    mesh = np.meshgrid(np.arange(128, 255, 2), np.arange(0, 169, 8), gains, indexing="ij")
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
    static = filters[:, 2] / 4 * (1 - filters[:, 0] / 256) / (1 + filters[:, 1] / 256)
    if reference is not None:
        filters = filters[1 / static <= reference.dead_band + 1e-12]
    filters = _promising(plant, timer, filters, reference)
    qualities: dict[int, StepQuality] = {}
    for step in STEPS:
        quality = step_quality(plant, filters, timer, step)
        passed = _passes(quality, step, criterion, reference)
        filters = filters[passed]
        qualities = {s: q.of(passed) for s, q in (qualities | {step: quality}).items()}
    order = np.argsort(_nominal_score(qualities), kind="stable")[:keep]
    order = order[_passes_everywhere(plant, timer, filters[order], reference)]
    filters = filters[order]
    qualities = {s: q.of(order) for s, q in qualities.items()}
    plants = plants_about(plant, criterion.uncertainty)
    robust = robustness(plants, filters, timer, 0.0 if reference is None else reference.dead_band)
    found = [
        make_candidate(_registers(filters[i], timer), qualities, robust, i)
        for i in range(len(filters))
        if all(
            np.isfinite(robust.settling[step][i])
            and robust.overshoot[step][i] <= _allowed_off_nominal(step, criterion, reference)
            for step in SCORED
        )
    ]
    return sorted(found, key=lambda candidate: candidate.score)


def _passes_everywhere(
    plant: Plant, timer: int, filters: Bytes, reference: Candidate | None
) -> NDArray[np.bool_]:
    """No more overshoot than the thesis's bytes from any of sixteen places between two counts."""
    passed = np.ones(len(filters), dtype=np.bool_)
    for step in COMPARED:
        allowed = 0
        if reference is not None:
            r = reference.registers
            theirs = step_quality(
                plant, np.array([[r.zero, r.pole, r.gain]]), timer, step, places=MANY_PLACES
            )
            allowed = max(int(theirs.overshoot[0]), 0)
        passed &= step_quality(plant, filters, timer, step, places=MANY_PLACES).overshoot <= allowed
    return passed


def _nominal_score(qualities: dict[int, StepQuality]) -> NDArray[np.float64]:
    return np.asarray(sum(qualities[step].settling.mean(axis=1) for step in SCORED), dtype=np.float64)


def _allowed_off_nominal(step: int, criterion: Criterion, reference: Candidate | None) -> float:
    theirs = 0 if reference is None else reference.robust_overshoot[step]
    return max(criterion.small_overshoot, 0.02 * step, theirs)


def _promising(
    plant: Plant, timer: int, filters: Bytes, reference: Candidate | None, most: int = 1500
) -> Bytes:
    """Those that pass from one place between two counts; when many do, the ones that settle first."""
    qualities: dict[int, StepQuality] = {}
    for step in SCORED[::-1]:
        quality = step_quality(plant, filters, timer, step, places=PLACES[:1])
        passed = _within_worst(quality, step, reference)
        filters = filters[passed]
        qualities = {s: q.of(passed) for s, q in (qualities | {step: quality}).items()}
    return filters[np.argsort(_nominal_score(qualities), kind="stable")[:most]]


def _within_worst(quality: StepQuality, step: int, reference: Candidate | None) -> NDArray[np.bool_]:
    """Overshoot and worst settling no more than the reference's; finite and none where there is no reference."""
    worst = quality.settling.max(axis=1)
    if reference is None:
        return np.asarray((quality.overshoot <= 0) & np.isfinite(worst), dtype=np.bool_)
    return np.asarray(
        (quality.overshoot <= reference.overshoot[step]) & (worst <= reference.settling[step] + 1e-9),
        dtype=np.bool_,
    )


def _passes(
    quality: StepQuality, step: int, criterion: Criterion, reference: Candidate | None
) -> NDArray[np.bool_]:
    if step not in COMPARED:
        return quality.overshoot <= criterion.small_overshoot
    passed = _within_worst(quality, step, reference)
    if reference is not None:
        passed &= np.median(quality.settling, axis=1) <= reference.median_settling[step] + 1e-9
    return passed
