"""What the other image confirms."""

import numpy as np

from perception.depth.match.consistency import without_specks


def test_a_small_patch_that_stands_apart_is_not_confirmed() -> None:
    place = np.full((40, 40), 5, np.float32)
    place[10:14, 10:16] = 12  # 24 pixels, fewer than the 30 of a surface
    place[25:33, 25:33] = 12  # 64
    confirmed = without_specks(np.ones((40, 40), bool), place)
    assert not confirmed[10:14, 10:16].any()
    assert confirmed.sum() == 40 * 40 - 24


def test_what_was_not_confirmed_stays_so_and_a_slope_is_no_patch() -> None:
    confirmed = np.ones((20, 40), bool)
    confirmed[:, 20] = False
    place = np.tile(np.linspace(0, 30, 40, dtype=np.float32), (20, 1))
    assert (without_specks(confirmed, place) == confirmed).all()
