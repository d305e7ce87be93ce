"""A surface's outline drawn back to the image's edge."""

import numpy as np

from perception.depth.refine.outline import align_outlines

EDGE = 30


def fat_board(grown: int, near_grey: float, far_grey: float, noise: float) -> tuple[np.ndarray, np.ndarray]:
    """A board at 10 px from column EDGE on before a wall at 4 px, its disparity grown to the left; and the image."""
    disparity = np.full((40, 60), 4, np.float32)
    disparity[:, EDGE - grown :] = 10
    grey = np.full((40, 60), far_grey, np.float32)
    grey[:, EDGE:] = near_grey
    grey += np.random.default_rng(0).normal(0, noise, grey.shape).astype(np.float32)
    return disparity, grey


def test_a_surface_that_grew_over_its_outline_is_drawn_back() -> None:
    disparity, grey = fat_board(3, 150, 60, noise=2)
    aligned = align_outlines(disparity, grey, 2.0)
    # The board's side holds wall too and is wide: a pixel far out in the noise may stay with it.
    assert np.mean(aligned[:, EDGE - 3 : EDGE] < 7) > 0.95
    assert (aligned[:, EDGE:] > 7).all()


def test_a_surface_that_shrank_is_drawn_out() -> None:
    disparity, grey = fat_board(-3, 150, 60, noise=2)
    aligned = align_outlines(disparity, grey, 2.0)
    # The wall's side holds board too and is wide: a pixel far out in the noise may stay with it.
    assert np.mean(aligned[:, EDGE : EDGE + 3] > 7) > 0.95
    assert (aligned[:, :EDGE] < 7).all()


def test_a_image_without_an_edge_moves_no_outline() -> None:
    disparity, grey = fat_board(3, 100, 100, noise=2)
    aligned = align_outlines(disparity, grey, 2.0)
    # Both sides have one mean and one variance; only a pixel beyond three deviations can seem to be of one of them.
    assert np.mean(np.abs(aligned - disparity) > 1) < 0.005


def test_a_slanted_surface_is_no_jump() -> None:
    # 11 pixels of window at .1 px a pixel are 1 px.
    disparity = np.tile(np.linspace(0, 6, 61, dtype=np.float32)[:60], (40, 1))
    grey = np.random.default_rng(1).uniform(0, 255, (40, 60)).astype(np.float32)
    assert (align_outlines(disparity, grey, 1.0) == disparity).all()
