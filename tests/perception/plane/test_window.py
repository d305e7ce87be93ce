"""Windows and their blocks."""

import numpy as np
import pytest

from perception.plane.window import Window


def test_blocks_and_image_are_one_another() -> None:
    window = Window(3, 5, 4, 6, 8)
    field = np.arange(48 * 32, dtype=np.float32).reshape(48, 32)
    blocks = window.by_blocks(field)
    assert blocks.shape == (24, 64)
    assert np.array_equal(blocks[5].reshape(8, 8), field[8:16, 8:16])
    assert np.array_equal(window.from_blocks(blocks), field)


def test_coordinates_are_those_of_the_pixels() -> None:
    window = Window(10, 20, 5, 3, 8)
    x, y = (window.from_blocks(part) for part in window.coordinates())
    columns, rows = window.pixels()
    places = window.to_pixels @ np.stack((x.ravel(), y.ravel(), np.ones(x.size)))
    assert places[0] == pytest.approx(columns.ravel(), abs=1e-5)
    assert places[1] == pytest.approx(rows.ravel(), abs=1e-5)
    assert window.from_pixels @ window.to_pixels == pytest.approx(np.eye(3))


def test_a_central_window_is_centred_and_halved_about_its_middle() -> None:
    window = Window.central((128, 160), 80, 90)
    assert (window.left, window.top, window.width, window.height) == (40, 20, 80, 88)
    half = window.halved()
    assert (half.left, half.top, half.width, half.block) == (20, 10, 40, 4)
    assert half.halved().block == 4
