"""Regularisation by the membrane."""

import numpy as np
import pytest

from perception.depth.refine.membrane import Springs, relax_membrane, relaxed_variance


def exact_minimum(
    measured: np.ndarray, variance: np.ndarray, springs: Springs, strength: float
) -> np.ndarray:
    """Solve the normal equations of (2.15) directly."""
    height, width = measured.shape
    count = height * width
    matrix, right = np.zeros((count, count)), np.zeros(count)
    for y in range(height):
        for x in range(width):
            i = y * width + x
            if np.isfinite(measured[y, x]):
                matrix[i, i] += strength / variance[y, x]
                right[i] += strength / variance[y, x] * measured[y, x]
            for dy, dx in ((0, 1), (1, 0)):
                if y + dy < height and x + dx < width:
                    j = (y + dy) * width + x + dx
                    spring = springs.right[y, x] if dx else springs.down[y, x]
                    matrix[i, i] += spring
                    matrix[j, j] += spring
                    matrix[i, j] -= spring
                    matrix[j, i] -= spring
    return np.linalg.solve(matrix, right).reshape(height, width)


@pytest.mark.parametrize("even", [True, False])
def test_the_relaxation_ends_at_the_minimum_of_the_energy(even):
    rng = np.random.default_rng(0)
    measured = rng.normal(0, 1, (9, 11)).astype(np.float32)
    measured[3:6, 4:8] = np.nan
    variance = rng.uniform(0.2, 2, (9, 11)).astype(np.float32)
    springs = Springs.even((9, 11))
    if not even:
        springs = Springs(
            rng.uniform(0.05, 1, (8, 11)).astype(np.float32), rng.uniform(0.05, 1, (9, 10)).astype(np.float32)
        )
    relaxed = relax_membrane(measured, variance, springs, strength=4.0, iterations=400)
    # Single precision.
    assert relaxed == pytest.approx(exact_minimum(measured, variance, springs, 4.0), abs=1e-4)


def test_holes_are_filled_and_a_slanted_surface_stays():
    plane = np.add.outer(0.3 * np.arange(20), 0.2 * np.arange(30)).astype(np.float32)
    measured = plane.copy()
    measured[6:14, 8:20] = np.nan
    relaxed = relax_membrane(measured, np.full_like(plane, 0.01), Springs.even(plane.shape), 4.0, 400)
    # A plane is harmonic; its free border bends it, and the hole lies four pixels away from there.
    assert np.abs(relaxed - plane)[5:15, 7:21].max() < 0.01


def test_springs_cut_at_an_edge_keep_a_step():
    step = np.where(np.arange(30) < 15, 5.0, 9.0).astype(np.float32)[None, :].repeat(12, axis=0)
    noisy = step + np.random.default_rng(0).normal(0, 0.3, step.shape).astype(np.float32)
    guide = np.where(np.arange(30) < 15, 50.0, 150.0).astype(np.float32)[None, :].repeat(12, axis=0)
    springs = Springs.cut_at_edges(guide, 10.0, noisy, 0.8)
    relaxed = relax_membrane(noisy, np.full_like(step, 0.09), springs, 0.05, 200)
    assert np.abs(relaxed - step).max() < 0.5
    assert np.std((relaxed - step)[:, :13]) < 0.5 * 0.3


def test_the_variance_of_an_average_is_the_corrected_one():
    measured, variance = np.zeros((7, 7), np.float32), np.ones((7, 7), np.float32)
    # (16·¼ + 1)/25 with w = 1 inside: var ū = 4/16 of four independent neighbours.
    assert relaxed_variance(measured, variance, Springs.even((7, 7)))[3, 3] == pytest.approx(0.2)
