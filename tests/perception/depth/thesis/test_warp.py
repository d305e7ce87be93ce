"""The map warped to the new view, thesis (2.29)."""

import numpy as np
import pytest

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.epipolar import Projection
from perception.depth.thesis.warp import warp_map


def row(*values: float) -> np.ndarray:
    return np.array([values], np.float32)


def moved_to(x: np.ndarray) -> Projection:
    one = np.ones_like(x)
    return Projection(x, np.zeros_like(x), one, one, 0 * one, 0.0)


def certain(value: np.ndarray, variance: float = 1e-6) -> InverseDepth:
    return InverseDepth(value, np.full_like(value, variance), np.zeros_like(value))


def test_whole_pixels_stay_as_they_are() -> None:
    state = warp_map(certain(row(0.1, 0.2, 0.3, 0.4)), moved_to(row(1, 2, 3, 4)))
    # the distance 0 enters as 1/(0 + .001); the neighbours a whole pixel away are not reached
    np.testing.assert_allclose(state.value, row(np.nan, 0.1, 0.2, 0.3), rtol=1e-6)


def test_uncovered_pixel_is_unknown_and_not_zero() -> None:
    state = warp_map(certain(row(0.5, 0.5, 0.5, 0.5)), moved_to(row(0, 1, 3, 4)))
    assert np.isnan(state.value[0, 2])
    assert np.isnan(state.variance[0, 2])


def test_nearer_surface_hides_and_is_not_averaged() -> None:
    # a foreground at 1 m (ρ = 1) lands on a background at 5 m (ρ = .2)
    state = warp_map(certain(row(0.2, 0.2, 1.0, 0.2)), moved_to(row(0, 1, 1, 3)))
    assert state.value[0, 1] == pytest.approx(1.0, rel=1e-6)
    assert state.value[0, 0] == pytest.approx(0.2, rel=1e-6)


def test_one_surface_is_interpolated_by_inverse_square_distance() -> None:
    # two points .25 and .5 px to either side of pixel 1: weights 1/.0625 and 1/.25 (and .001 against division by 0)
    state = warp_map(certain(row(0.500, 0.503)), moved_to(row(0.75, 1.5)), independent=False)
    near, far = 1 / (0.0625 + 1e-3), 1 / (0.25 + 1e-3)
    assert state.value[0, 1] == pytest.approx((near * 0.500 + far * 0.503) / (near + far), rel=1e-6)


@pytest.mark.parametrize("independent", [True, False], ids=["as printed", "errors shared"])
def test_variance_of_the_interpolation(independent: bool) -> None:
    values = InverseDepth(row(0.5, 0.5), row(4e-6, 9e-6), row(0, 0))
    state = warp_map(values, moved_to(row(0.75, 1.5)), independent=independent)
    near, far = 1 / (0.0625 + 1e-3), 1 / (0.25 + 1e-3)
    if independent:
        expected = (near**2 * 4e-6 + far**2 * 9e-6) / (near + far) ** 2
    else:
        expected = ((near * 2e-3 + far * 3e-3) / (near + far)) ** 2
    assert state.variance[0, 1] == pytest.approx(expected, rel=1e-5)


def test_points_that_leave_the_image_are_dropped() -> None:
    state = warp_map(certain(row(0.5, 0.5)), moved_to(row(-3, 7)))
    assert np.isnan(state.value).all()
