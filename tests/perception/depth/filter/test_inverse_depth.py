"""The recursive filter and the warp."""

import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.filter.forward_warp import forward_warp
from perception.depth.filter.inverse_depth import InverseDepth, fuse, predict_inverse_depth
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.refine.holes import fill_holes
from perception.depth.thesis.warp import warp_map

CAMERA = Pinhole(100.0, 100.0, 31.5, 23.5)
SHAPE = (48, 64)


def state(value, variance=1e-4, cost=0.1) -> InverseDepth:
    ones = np.ones(SHAPE, np.float32)
    return InverseDepth(*(np.asarray(part * ones, np.float32) for part in (value, variance, cost)))


CONFIRMED = np.ones(SHAPE, bool)
ANY = np.full(SHAPE, np.inf, np.float32)


def test_from_a_wrong_start_the_filter_finds_the_depth():
    # The case at which the filter in Z of (2.25)–(2.28) leaves for −19 m: 5 m seen from a start at 12 m ± 5 m,
    # f = 500 px, a baseline of .4 m an image, half a pixel of noise, 15 images.
    rng = np.random.default_rng(0)
    filtered = state(1 / 12, (5 / 12**2) ** 2)
    for _ in range(15):
        disparity = 500 * 0.4 / 5 + rng.normal(0, 0.5, SHAPE)
        measured = state((disparity / 200).astype(np.float32), (0.5 / 200) ** 2)
        filtered = fuse(filtered, measured, CONFIRMED, np.inf, ANY)
    # 15 measurements of .5/200 1/m: 65 ppm of 1/m, 16 mm at 5 m; mean over 3072 pixels to a fraction of it,
    # and the start draws 1/5 by (1/12 − 1/5)·P/(P₀) ≈ .004 m.
    assert filtered.depth.mean() == pytest.approx(5.0, abs=0.03)
    assert filtered.depth.std() == pytest.approx(0.5 / 200 / np.sqrt(15) * 25, rel=0.1)
    assert filtered.depth_std.mean() == pytest.approx(filtered.depth.std(), rel=0.1)


def test_the_prediction_is_that_of_the_moved_point():
    motion = Motion(np.eye(3), np.array([0.0, 0.0, -0.5]))
    before = state(0.5)
    moved = Epipolar(CAMERA, motion, SHAPE).project(before.value)
    predicted = predict_inverse_depth(before, moved, 0.0)
    # 2 m becomes 1.5 m; dρ'/dρ = 1/(1 − ρ/2)².
    assert predicted.value == pytest.approx(np.full(SHAPE, 1 / 1.5), rel=1e-5)
    assert predicted.variance == pytest.approx(np.full(SHAPE, 1e-4 / 0.75**4), rel=1e-4)


def test_process_noise_is_a_part_of_the_depth():
    moved = Epipolar(CAMERA, Motion.identity(), SHAPE).project(np.full(SHAPE, 0.5, np.float32))
    predicted = predict_inverse_depth(state(0.5, 0.0), moved, 0.02)
    assert np.sqrt(predicted.variance) == pytest.approx(np.full(SHAPE, 0.01), rel=1e-5)


def test_another_surface_replaces_and_is_not_averaged():
    fused = fuse(state(0.2), state(0.5), CONFIRMED, 3.0, ANY)
    assert fused.value == pytest.approx(np.full(SHAPE, 0.5))
    assert fused.variance == pytest.approx(np.full(SHAPE, 1e-4))


@pytest.mark.parametrize(
    ("deviation", "gap", "stays"), [(0.2, 0.3, True), (0.2, 0.7, False), (0.05, 0.1, False)]
)
def test_a_match_that_is_vague_by_itself_denies_no_sharp_prediction(
    deviation: float, gap: float, stays: bool
) -> None:
    # an edge along the motion: 20 times the prediction's deviation and far off, but not farther than it may be
    reach = np.full(SHAPE, 0.02, np.float32)
    fused = fuse(state(0.5, 0.01**2), state(0.5 + gap, deviation**2), CONFIRMED, 3.0, reach)
    assert fused.value == pytest.approx(np.full(SHAPE, 0.5 if stays else 0.5 + gap), rel=1e-5)
    assert fused.variance == pytest.approx(np.full(SHAPE, 0.01**2 if stays else deviation**2), rel=1e-5)


def test_the_noise_of_a_image_in_two_pairs_is_counted_once() -> None:
    # n₁ − n₀ and n₂ − n₁, each of variance 2s, have the correlation −½; their mean is (n₂ − n₀)/2 of variance s/2
    rng = np.random.default_rng(2)
    noise = rng.normal(0, 1e-2, (3, *SHAPE))
    first, second = (state((0.5 + noise[k + 1] - noise[k]).astype(np.float32), 2e-4) for k in (0, 1))
    fused = fuse(first, second, CONFIRMED, np.inf, ANY, shared=-0.5)
    np.testing.assert_allclose(fused.value, 0.5 + (noise[2] - noise[0]) / 2, atol=1e-6)
    np.testing.assert_allclose(fused.variance, 0.5e-4, rtol=1e-5)


def test_what_every_pair_repeats_is_not_averaged_away() -> None:
    filtered = state(0.5, 1e-4)
    for _ in range(200):
        filtered = fuse(filtered, state(0.5, 1e-4), CONFIRMED, np.inf, ANY, repeated=0.2e-4)
    # the noise of .8e-4 over 201 images, and what repeats
    np.testing.assert_allclose(filtered.variance, 0.2e-4 + 0.8e-4 / 201, rtol=1e-4)
    same = fuse(state(0.5, 1e-4), state(0.6, 1e-4), CONFIRMED, np.inf, ANY, repeated=1e-4)
    np.testing.assert_allclose(same.variance, 1e-4, rtol=1e-6)


def test_an_unconfirmed_match_does_not_move_a_known_depth():
    fused = fuse(state(0.2), state(0.201), ~CONFIRMED, 3.0, ANY)
    assert fused.value == pytest.approx(np.full(SHAPE, 0.2))


def test_a_guess_gives_way_to_the_first_confirmed_match():
    fused = fuse(state(0.2, 1.0, cost=1.0), state(0.21), CONFIRMED, 3.0, ANY)
    assert fused.value == pytest.approx(np.full(SHAPE, 0.21))
    assert (fused.cost < 1).all()


def test_where_nothing_is_known_the_measurement_stands():
    fused = fuse(InverseDepth.unknown(SHAPE), state(0.3), ~CONFIRMED, 3.0, ANY)
    assert fused.value == pytest.approx(np.full(SHAPE, 0.3))


def move_right(state_before: InverseDepth, pixels_at_one: float) -> InverseDepth:
    """The camera moves so that a point at 1 m goes `pixels_at_one` to the left."""
    motion = Motion(np.eye(3), np.array([-pixels_at_one / 100, 0, 0]))
    moved = Epipolar(CAMERA, motion, SHAPE).project(state_before.value)
    return warp_map(predict_inverse_depth(state_before, moved, 0.0), moved)


def test_the_nearer_surface_hides_and_what_comes_into_view_is_a_hole():
    value = np.full(SHAPE, 0.2, np.float32)
    value[:, 30:40] = 1.0
    warped = move_right(
        InverseDepth(value, np.full(SHAPE, 1e-6, np.float32), np.full(SHAPE, 0.1, np.float32)), 10.0
    )
    # The box goes 10 px to the left, the wall 2 px: 8 px of wall are hidden before it and 8 px are a hole behind it.
    row = warped.value[20]
    assert row[20:30] == pytest.approx(np.full(10, 1.0))
    assert np.isnan(row[31:37]).all()
    assert row[:19] == pytest.approx(np.full(19, 0.2))
    assert row[39:60] == pytest.approx(np.full(21, 0.2))


def test_a_slanted_map_is_interpolated_at_the_pixels():
    value = (0.5 + 0.002 * np.arange(64, dtype=np.float32))[None, :].repeat(48, axis=0)
    warped = move_right(
        InverseDepth(value, np.full(SHAPE, 1e-8, np.float32), np.full(SHAPE, 0.1, np.float32)), 5.0
    )
    # x' = x − 5ρ(x), so at x' the map is (0.5 + 0.002 x')/(1 − 0.01); weights by distance, not linear, cost
    # up to a tenth of the step between pixels.
    expected = (0.5 + 0.002 * np.arange(64)) / 0.99
    assert np.abs(warped.value[20] - expected)[2:55].max() < 3e-4


def test_warping_does_not_make_a_map_surer_by_itself():
    warped = move_right(state(0.5, 1e-4), 5.0)
    known = np.isfinite(warped.value)
    assert warped.variance[known] == pytest.approx(np.full(known.sum(), 1e-4), rel=1e-3)


def test_an_occlusion_takes_the_farther_and_another_hole_the_nearest_side():
    row = np.array([0.8, 0.8, np.nan, np.nan, np.nan, 0.2, 0.2], np.float32)
    values = row[None, :].repeat(3, axis=0)
    everywhere = np.ones(values.shape, bool)
    far, _, _ = fill_holes(values, everywhere, everywhere)
    near, spread, reach = fill_holes(values, ~everywhere, everywhere)
    assert far[1, 2:5].tolist() == pytest.approx([0.2, 0.2, 0.2])
    assert near[1, 2:5].tolist() == pytest.approx([0.8, 0.8, 0.2])
    assert spread[1, 3] == pytest.approx(0.6)
    assert reach[1, 3] == 2


def test_a_map_of_nothing_but_holes_stays_one():
    nothing = np.full((3, 4), np.nan, np.float32)
    filled, _, _ = fill_holes(nothing, np.ones((3, 4), bool), np.ones((3, 4), bool))
    assert np.isnan(filled).all()


def test_an_error_grows_where_the_surface_is_pressed_together() -> None:
    # Disparity 8 + .1 (x − 32): a map wrong by e everywhere lands 8.. − e further left, where the plane is e·.1 less
    # deep; the error at a pixel becomes e/(1 − .1) and so does the deviation.
    slope, offset = 0.1, np.float32(1e-3)
    plane = (0.8 + slope * (np.arange(SHAPE[1]) - 32) / 10).astype(np.float32)[None, :].repeat(SHAPE[0], 0)
    motion = Motion(np.eye(3), np.array([-0.1, 0, 0]))
    geometry = Epipolar(CAMERA, motion, SHAPE)

    def warped(value: np.ndarray) -> InverseDepth:
        moved = geometry.project(value)
        return forward_warp(predict_inverse_depth(state(value), moved, 0.0), moved)

    inner = (slice(8, -8), slice(8, 32))
    grown = (warped(plane + offset).value - warped(plane).value)[inner] / offset
    np.testing.assert_allclose(np.median(grown), 1 / (1 - slope), rtol=0.01)
    np.testing.assert_allclose(np.sqrt(warped(plane).variance[inner] / 1e-4), 1 / (1 - slope), rtol=0.01)
