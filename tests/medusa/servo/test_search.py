"""The search over the bytes against the thesis's bytes, judged by figures it does not compute itself."""

import numpy as np
import pytest

from medusa.errors import CommandError
from medusa.servo.loop import simulate_position
from medusa.servo.margins import grid_margins, margins
from medusa.servo.position_filter import Filter, compensated_gain_limit, dead_band
from medusa.servo.response import settled_from, step_figures
from medusa.servo.search import Criterion, best_timer, search_filter, search_timers
from medusa.servo.thesis import JOINTS, PERIOD
from medusa.servo.trials import Candidate, assess, step_quality, thesis_registers


@pytest.fixture(scope="module", params=["tilt", "pan"])
def found(request: pytest.FixtureRequest) -> tuple[str, Candidate]:
    return request.param, search_filter(JOINTS[request.param].plant, 255)


def test_found_bytes_settle_sooner_than_the_thesis_without_more_overshoot(
    found: tuple[str, Candidate],
) -> None:
    name, best = found
    plant = JOINTS[name].plant
    theirs = thesis_registers(plant, 255)
    times: dict[int, list[tuple[float, float]]] = {100: [], 1000: []}
    for step in (100, -100, 1000, -1000):
        for start in (0.0, 0.25, 0.5, 0.75):  # places between two counts
            ours = simulate_position(plant, best.registers, [step] * 150, start=start)
            before = simulate_position(plant, theirs, [step] * 150, start=start)
            beyond = [max(0, int(((run.counts - step) * np.sign(step)).max())) for run in (ours, before)]
            assert beyond[0] <= max(beyond[1], 2 if abs(step) == 100 else 0)
            settling = [step_figures(run.time, run.shaft, step).settling for run in (ours, before)]
            times[abs(step)].append((settling[0], settling[1]))
    for step, pairs in times.items():
        found_times, their_times = zip(*pairs, strict=True)
        assert max(found_times) <= max(their_times)
        assert np.median(found_times) <= np.median(their_times)
        if step == 1000:  # a saturated step: their tail dies with T_M
            assert max(found_times) < 0.85 * min(their_times)


def test_found_bytes_have_the_margins_and_the_smaller_dead_band(found: tuple[str, Candidate]) -> None:
    name, best = found
    plant = JOINTS[name].plant
    stated = Criterion()
    exact = margins(plant.at_timer(255), best.registers.filter)
    assert exact.gain >= stated.gain_margin * 0.98  # the search reads margins on a grid, 2 %
    assert exact.phase_deg >= stated.phase_margin_deg * 0.98
    assert dead_band(best.registers.filter) < 0.75 * dead_band(thesis_registers(plant, 255).filter)


def test_found_bytes_settle_on_plants_twenty_per_cent_off(found: tuple[str, Candidate]) -> None:
    name, best = found
    for time_constant in (0.8, 1.2):
        for gain in (0.8, 1.2):
            plant = JOINTS[name].plant.scaled(time_constant, gain)
            run = simulate_position(plant, best.registers, [1000] * 200)
            # The mean over nine plants is stated; the worst of them takes a fifth longer at most, as T_M does.
            assert step_figures(run.time, run.shaft, 1000).settling <= 1.2 * best.robust_settling[1000]
            assert (run.counts - 1000).max() <= max(20, best.robust_overshoot[1000])  # 2 %


def test_an_impossible_criterion_is_refused_with_what_was_asked() -> None:
    with pytest.raises(CommandError, match="margins of 9 and 85°"):
        search_filter(JOINTS["pan"].plant, 255, Criterion(gain_margin=9.0, phase_margin_deg=85.0))


def test_a_shorter_sample_period_narrows_the_dead_band() -> None:
    found = search_timers(JOINTS["pan"].plant, (255, 170))
    assert set(found) == {255, 170}
    # D(1) of the double pole grows as 1/T: at two thirds of the period the dead band is about that much narrower.
    assert found[170].dead_band < 0.8 * found[255].dead_band
    assert best_timer(found) == 170
    with pytest.raises(CommandError, match="no sample timer"):
        best_timer({})


def test_assessment_of_the_thesis_bytes_gives_the_figures_of_the_page() -> None:
    plant = JOINTS["vergence"].plant
    theirs = assess(plant, thesis_registers(plant, 255))
    # 22.5, 65.5 and 104.5 ms are those of a start on an encoder edge (page 1.6), the worst place takes at most
    # one sample more.
    assert 0.0225 <= theirs.settling[100] <= 0.0226
    assert 0.0655 <= theirs.settling[1000] <= 0.0655 + PERIOD + 1e-4
    assert theirs.overshoot[100] == 2
    assert theirs.overshoot[1000] == 0


def test_step_quality_of_many_filters_is_that_of_each() -> None:
    plant = JOINTS["pan"].plant
    filters = np.array([[197, 0, 7], [197, 0, 40], [150, 60, 20]])
    together = step_quality(plant, filters, 255, 100)
    for i in range(len(filters)):
        alone = step_quality(plant, filters[i : i + 1], 255, 100)
        assert np.array_equal(alone.settling[0], together.settling[i])
        assert alone.overshoot[0] == together.overshoot[i]


def test_grid_margins_agree_with_python_control() -> None:
    plant = JOINTS["vergence"].plant.discretise(PERIOD)
    filters = [Filter(0.88, 0.0, 1.14), Filter(0.8, 0.25, 2.5), Filter(0.7, 0.5, 4.0)]
    gain, phase = grid_margins(
        plant, [f.zero for f in filters], [f.pole for f in filters], [f.gain for f in filters]
    )
    for i, controller in enumerate(filters):
        exact = margins(plant, controller)
        assert gain[i] == pytest.approx(exact.gain, rel=0.03)  # grid of 200 frequencies over two decades
        assert phase[i] == pytest.approx(exact.phase_deg, abs=3.0)
    # The compensated loop's gain margin is K_max/K in closed form.
    assert margins(plant, Filter(plant.pole, 0.0, 1.14)).gain == pytest.approx(
        compensated_gain_limit(plant) / 1.14
    )


def test_settling_is_from_the_sample_after_the_last_one_outside() -> None:
    inside = np.array([[False, True], [True, True], [False, True], [True, True], [True, False]])
    assert settled_from(inside).tolist() == [3, 5]
    assert settled_from(np.array([True, True])) == 0
