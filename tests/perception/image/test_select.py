"""The masked choice is np.where."""

import numpy as np
import pytest

from perception.image.select import select

RNG = np.random.default_rng(0)
MASK = RNG.random((7, 9)) < 0.5
FIELD = RNG.normal(0, 1, (7, 9)).astype(np.float32)


@pytest.mark.parametrize("yes", [FIELD, 3.0, np.nan])
@pytest.mark.parametrize("no", [FIELD + 1, -1.0, np.inf])
def test_it_chooses_as_where_does(yes: np.ndarray | float, no: np.ndarray | float) -> None:
    found = select(MASK, yes, no)
    assert found.dtype == np.float32
    np.testing.assert_array_equal(found, np.where(MASK, yes, no).astype(np.float32))


def test_parts_of_larger_images_are_chosen_from_too() -> None:
    found = select(MASK[2:5, ::2], FIELD[2:5, ::2], FIELD[3:6, ::2])
    np.testing.assert_array_equal(found, np.where(MASK[2:5, ::2], FIELD[2:5, ::2], FIELD[3:6, ::2]))
