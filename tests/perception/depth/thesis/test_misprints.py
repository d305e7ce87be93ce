"""Where the thesis's print is wrong: the literal figures of the collected equations, chapter 2."""

import numpy as np
import pytest

from perception.depth.filter.inverse_depth import InverseDepth, fuse
from perception.depth.refine.membrane import Springs, relax_membrane, relaxed_variance
from perception.depth.refine.parabola import disparity_variance, fit_parabola


def around_a_middle(neighbours: float, middle: float) -> np.ndarray:
    values = np.full((3, 3), neighbours, np.float32)
    values[1, 1] = middle
    return values


def test_2_18_with_weight_one_is_8125_and_not_1_625() -> None:
    # w = 1 of (2.16) is λ = 4 of (2.15); var ū = 4 · 9/16 = 2.25 and σ² = 1: (2.25 + 1)/(1 + 1)²
    spread = relaxed_variance(
        np.zeros((3, 3), np.float32), around_a_middle(9.0, 1.0), Springs.even((3, 3)), strength=4.0
    )
    assert spread[1, 1] == pytest.approx(0.8125, rel=1e-6)


def test_2_16_as_printed_is_that_of_four_lambda() -> None:
    # with λ = σ = 1 the print gives u = (ū + d)/2; a tiny variance pins the neighbours 3, 5, 1, 7 (ū = 4)
    measured = np.array([[0, 3, 0], [5, 10, 1], [0, 7, 0]], np.float32)
    found = relax_membrane(measured, around_a_middle(1e-6, 1.0), Springs.even((3, 3)), 4.0, 1)
    # the pins give by 1e-6 of some units
    assert found[1, 1] == pytest.approx(7.0, abs=1e-4)


def test_2_11_is_the_scatter_of_matches_under_noise_of_two_levels() -> None:
    rng = np.random.default_rng(1)
    draws, pixels, sigma = 4000, 49, 2.0
    slope = rng.normal(0, 6, (1, pixels))
    noise = rng.normal(0, sigma, (draws, pixels)) - rng.normal(0, sigma, (draws, pixels))
    below, here, above = (
        np.sum((slope * u + noise) ** 2, axis=1)[None].astype(np.float32) for u in (-1.0, 0.0, 1.0)
    )
    offset, curvature, least = fit_parabola(below, here, above)
    true = 2 * sigma**2 / float(np.sum(slope**2))
    # least squares in closed form; the mean of 4000 estimates with 48 degrees of freedom is good to .3 %
    assert float(np.mean(disparity_variance(least, curvature, pixels))) == pytest.approx(true, rel=0.01)
    # the scatter of 4000 draws is known to 2.2 %
    assert float(np.var(offset)) == pytest.approx(true, rel=0.08)


@pytest.mark.parametrize(("variance_z", "expected"), [(25.0, 5.001), (1.0, 5.025), (0.1, 5.243)])
def test_inverse_depth_converges_where_the_filter_in_z_diverges(variance_z: float, expected: float) -> None:
    # true 5 m, prior 12 m, f·B = 500 · .4 = 200 px·m, σ = .5 px, 15 images. In Z the first update leaves for
    # −4.7 m (25 m²) and −10.6 m (1 m²). P of ρ is P_Z/Z⁴.
    def belief(value: float, variance: float) -> InverseDepth:
        return InverseDepth(*(np.full((1, 1), number, np.float32) for number in (value, variance, 0.1)))

    state, measured = belief(1 / 12, variance_z / 12**4), belief(1 / 5, (0.5 / 200) ** 2)
    for _ in range(15):
        state = fuse(state, measured, np.ones((1, 1), bool), np.inf, np.full((1, 1), np.inf, np.float32))
    # half of the last digit of the page's figures
    assert float(state.depth[0, 0]) == pytest.approx(expected, abs=6e-4)
