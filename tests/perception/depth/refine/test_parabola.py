"""Sub-pixel place and uncertainty of a match."""

import numpy as np
import pytest

from perception.depth.refine.parabola import Quadric, disparity_variance, fit_parabola


def field(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


def test_a_parabola_is_found_exactly():
    q = [3 * (u - 0.25) ** 2 + 7 for u in (-1, 0, 1)]
    offset, curvature, least = fit_parabola(*(field(value) for value in q))
    assert offset[0, 0] == pytest.approx(0.25)
    assert curvature[0, 0] == pytest.approx(6.0)
    assert least[0, 0] == pytest.approx(7.0)


def test_a_ridge_and_a_far_minimum_are_holes():
    offset, _, _ = fit_parabola(field(1.0, 5.0), field(2.0, 2.0), field(1.0, 0.5))
    assert np.isnan(offset).all()


def test_the_variance_does_not_depend_on_the_grey_scale():
    # (2.11) as printed changes by 1/100 when the grey levels are ten times as large.
    assert disparity_variance(field(100.0), field(50.0), 49) == pytest.approx(
        disparity_variance(field(1.0), field(0.5), 49)
    )


def test_the_variance_is_that_of_many_noisy_matches():
    # Pure translation of a known signal: the error surface is exactly quadratic in small shifts, so the
    # spread of the minimum must be that of the corrected (2.11); 4 % is the sampling error of 2000 runs.
    rng = np.random.default_rng(0)
    x = np.arange(49) * 0.35
    shifts, stated = [], []
    for _ in range(2000):
        first = 30 * np.sin(x) + rng.normal(0, 2, 49)
        second = [30 * np.sin(x + 0.35 * u) for u in (-0.5, 0.0, 0.5)]
        noise = rng.normal(0, 2, 49)
        q = [field(float(np.sum((first - signal - noise) ** 2))) for signal in second]
        offset, curvature, least = fit_parabola(*q, step=0.5)
        shifts.append(offset[0, 0])
        stated.append(disparity_variance(least, curvature, 49)[0, 0])
    ratio = np.nanstd(shifts) / np.sqrt(np.nanmean(stated))
    assert 0.94 < ratio < 1.06


def test_an_oblique_valley_has_its_minimum_where_both_slopes_vanish():
    # q = (x + y − 0.3)² + 0.1 (x − y)²: minimum at (0.15, 0.15); two separate parabolas would give 0.27.
    quadric = Quadric(field(0.09), field(-0.6), field(-0.6), field(2.2), field(1.8), field(2.2))
    u, v, least = quadric.minimum()
    assert (u[0, 0], v[0, 0], least[0, 0]) == pytest.approx((0.15, 0.15, 0.0), abs=1e-4)
    uu, uv, vv = quadric.covariance(field(1.0))
    # 2 H⁻¹ with H = [[2.2, 1.8], [1.8, 2.2]]
    assert (uu[0, 0], uv[0, 0], vv[0, 0]) == pytest.approx((2.75, -2.25, 2.75), rel=1e-3)


def test_the_soft_epipolar_term_makes_an_edge_across_the_motion_measurable():
    # An upright edge: q = (u − 0.2)² determines no v, and its Hessian is singular.
    quadric = Quadric(field(0.04), field(-0.4), field(0.0), field(2.0), field(0.0), field(0.0))
    u, v, _ = quadric.minimum(0.5)
    assert (u[0, 0], v[0, 0]) == pytest.approx((0.2, 0.0), abs=1e-5)
    # 2 s² H⁻¹ with H = diag(2, 2·½)
    uu, _, vv = quadric.covariance(field(1.0), 0.5)
    assert (uu[0, 0], vv[0, 0]) == pytest.approx((1.0, 2.0), rel=1e-4)
