"""Scanline aggregation."""

from itertools import pairwise, product

import numpy as np

from perception.depth.match.plane_sweep import WORST
from perception.depth.match.scanline import (
    adapt_p2,
    aggregate,
    aggregate_lines,
    blend_costs,
    cheapest,
    choose,
    pick,
)


def test_a_path_reaches_the_least_energy_of_all_paths():
    rng = np.random.default_rng(0)
    costs = rng.integers(0, 50, (5, 4, 1)).astype(np.uint8)
    p1, p2 = 8, 30

    def energy(path: tuple[int, ...]) -> int:
        data = sum(int(costs[n, k, 0]) for n, k in enumerate(path))
        steps = (abs(a - b) for a, b in pairwise(path))
        return data + sum(0 if step == 0 else p1 if step == 1 else p2 for step in steps)

    possible = list(product(range(4), repeat=5))
    paths = np.stack((costs, costs[::-1]), axis=2)
    aggregate_lines(paths, p1, np.full((4, 1), p2, np.uint8))
    # Down plus up counts the line's own cost twice; per line both sums are relative to their least.
    for n in range(5):
        through = np.array([min(energy(path) for path in possible if path[n] == k) for k in range(4)])
        summed = paths[n, :, 0, 0].astype(int) + paths[4 - n, :, 1, 0] - costs[n, :, 0]
        assert (summed - summed.min() == through - through.min()).all()


def test_rows_and_columns_are_treated_alike():
    rng = np.random.default_rng(1)
    costs = rng.integers(0, WORST, (6, 12, 9)).astype(np.uint8)
    guide = rng.uniform(0, 255, (12, 9)).astype(np.float32)
    upright = aggregate(costs, 40, adapt_p2(guide, 150, 48, 10.0))
    turned = aggregate(
        np.ascontiguousarray(costs.transpose(0, 2, 1)),
        40,
        adapt_p2(np.ascontiguousarray(guide.T), 150, 48, 10.0),
    )
    assert (upright == turned.transpose(0, 2, 1)).all()


def test_p2_is_less_across_an_edge_of_the_image():
    guide = np.zeros((4, 6), np.float32)
    guide[:, 3:] = 100
    down, right = adapt_p2(guide, 150, 40, 10.0)
    assert (down == 150).all()
    assert right[2].tolist() == [40] * 4
    assert right[1].tolist() == [150] * 4


def test_the_dearest_path_fits_a_byte():
    # every plane but one costs the most, and which one changes from line to line, so that paths pay P2
    costs = np.full((6, 8, 1), WORST, np.uint8)
    costs[np.arange(6), np.array([0, 7, 0, 7, 0, 7])] = 0
    p1, p2 = WORST, 255 - WORST
    paths = np.stack((costs, costs[::-1]), axis=2)
    aggregate_lines(paths, p1, np.full((5, 1), p2, np.uint8))
    wide = costs[0, :, 0].astype(int)
    for n in range(1, 6):
        level = wide - wide.min()
        padded = np.pad(level, 1, constant_values=10**6)
        raised = np.minimum(padded[:-2], padded[2:]) + p1
        wide = costs[n, :, 0] + np.minimum(np.minimum(level, raised), p2)
    assert paths[5, :, 0, 0].tolist() == wide.tolist()


def test_of_equally_cheap_planes_the_first_is_chosen():
    costs = np.array([7, 3, 5, 3, 9], np.int16)[:, None, None]
    assert cheapest(costs).tolist() == [[1]]
    assert pick(costs, np.array([[4]], np.int16)).tolist() == [[9]]


def test_the_place_between_planes_is_that_of_the_parabola():
    total = np.array([40, 12, 4, 16, 40], np.int16)[:, None, None].repeat(3, axis=1)
    plane, place = choose(total)
    assert (plane == 2).all()
    # ½(12 − 16)/(12 − 8 + 16)
    assert np.allclose(place, 2 - 0.1)


def test_a_second_aggregation_takes_in_the_lines_beside_its_own():
    rng = np.random.default_rng(2)
    right, height, width = 3, 24, 30
    # A level surface at plane 3 whose cost is lower by 18 on the average, under noise of deviation 30.
    costs = 50 + rng.normal(0, 30, (height, 8, width)).transpose(1, 0, 2)
    costs[right] -= 18
    costs = np.ascontiguousarray(np.clip(costs, 0, WORST), np.uint8)
    p2 = adapt_p2(np.zeros((height, width), np.float32), 60, 30, 10.0)
    once = aggregate(costs, 30, p2)
    mixed = blend_costs(costs, once, WORST)
    aggregated = np.minimum((once - once.min(axis=0)) // 4, WORST)
    assert (mixed == (costs + aggregated) // 2).all()
    first, second = (np.mean(choose(found)[0] != right) for found in (once, aggregate(mixed, 30, p2)))
    # Each line takes in some 20 others, yet they repeat one another; less than three quarters is required.
    assert second < 0.75 * first
