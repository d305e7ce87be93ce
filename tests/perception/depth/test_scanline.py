"""The weak string."""

from itertools import pairwise, product

import numpy as np

from perception.depth.scanline import aggregate, choose, jump_costs, sweep_lines


def test_the_string_reaches_the_least_energy_of_all_paths():
    rng = np.random.default_rng(0)
    costs = rng.integers(0, 50, (5, 4, 1)).astype(np.int16)
    jumps = np.full((4, 1), 30, np.int16)
    bend = 8

    def energy(path: tuple[int, ...]) -> int:
        data = sum(int(costs[n, k, 0]) for n, k in enumerate(path))
        steps = (abs(a - b) for a, b in pairwise(path))
        return data + sum(0 if step == 0 else bend if step == 1 else 30 for step in steps)

    paths = list(product(range(4), repeat=5))
    total = np.zeros_like(costs)
    sweep_lines(costs, total, bend, jumps)
    # Down plus up counts the line's own cost twice; per line both sums are relative to their least.
    for n in range(5):
        through = np.array([min(energy(path) for path in paths if path[n] == k) for k in range(4)])
        summed = total[n, :, 0].astype(int) - costs[n, :, 0]
        assert (summed - summed.min() == through - through.min()).all()


def test_rows_and_columns_are_treated_alike():
    rng = np.random.default_rng(1)
    costs = rng.integers(0, 500, (12, 6, 9)).astype(np.int16)
    guide = rng.uniform(0, 255, (12, 9)).astype(np.float32)
    upright = aggregate(costs, 150, jump_costs(guide, 700, 180, 10.0))
    turned = aggregate(
        np.ascontiguousarray(costs.transpose(2, 1, 0)),
        150,
        jump_costs(np.ascontiguousarray(guide.T), 700, 180, 10.0),
    )
    assert (upright == turned.transpose(2, 1, 0)).all()


def test_a_jump_costs_less_across_an_edge_of_the_picture():
    guide = np.zeros((4, 6), np.float32)
    guide[:, 3:] = 100
    down, right = jump_costs(guide, 700, 150, 10.0)
    assert (down == 700).all()
    assert right[2].tolist() == [150] * 4
    assert right[1].tolist() == [700] * 4


def test_the_place_between_planes_is_that_of_the_parabola():
    total = np.array([40, 12, 4, 16, 40], np.int16)[None, :, None].repeat(3, axis=0)
    plane, place = choose(total)
    assert (plane == 2).all()
    # ½(12 − 16)/(12 − 8 + 16)
    assert np.allclose(place, 2 - 0.1)
