"""Bands of rows give what the whole image gives, whatever their number and that of the threads."""

import cv2
import numpy as np
import pytest

from perception.depth.estimator import DepthFromMotion
from perception.depth.settings import DEFAULT
from perception.image import bands as room
from perception.image.bands import Band, bands, join_bands, share
from tools.depth.scenes import slanted_plane


@pytest.mark.parametrize("shape", [(16, 16), (144, 192), (243, 321), (480, 640), (1080, 1920)])
def test_every_row_is_kept_once_and_stands_where_the_trim_says(shape: tuple[int, int]) -> None:
    rows = np.arange(shape[0])
    kept = []
    for band in bands(shape, 10):
        assert (rows[band.outer][band.trim] == rows[band.inner]).all()
        assert band.inner.start % room.STEP == 0
        kept.append(rows[band.inner])
    assert np.concatenate(kept).tolist() == rows.tolist()


def test_a_halo_ends_at_the_image() -> None:
    first, *_, last = bands((480, 640), 10)
    assert (first.outer.start, last.outer.stop) == (0, 480)
    assert first.outer.stop == first.inner.stop + 10


@pytest.mark.parametrize("pixels", [1 << 10, 1 << 13, 1 << 20])
def test_a_filter_in_bands_gives_the_same_bits(pixels: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(room, "PIXELS", pixels)
    monkeypatch.setattr(room, "ALONE", 0)
    image = np.random.default_rng(0).normal(0, 1, (100, 70)).astype(np.float32)

    def smooth(band: Band) -> tuple[np.ndarray, ...]:
        return (np.asarray(cv2.blur(image[band.outer], (9, 9)))[band.trim],)

    (found,) = join_bands((100, 70), smooth, 4)
    np.testing.assert_array_equal(found, cv2.blur(image, (9, 9)))


def test_work_may_share_work_of_its_own() -> None:
    done = np.zeros((3, 4), int)

    def row(i: int) -> None:
        share(lambda j: done.__setitem__((i, j), 1), range(4))

    share(row, range(3))
    assert done.all()


def test_what_goes_wrong_in_a_thread_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        share(lambda item: print(1 // item), [1, 0])


def run(anchored: bool) -> list[np.ndarray]:
    sequence = slanted_plane(frames=3, size=(130, 100), noise=2)
    estimator = DepthFromMotion(sequence.camera, DEFAULT, anchored)
    estimator.start(sequence.images[0])
    motion = sequence.motions[0]
    maps = [estimator.step(sequence.images[1], motion)]
    second = motion.then(sequence.motions[1]) if anchored else sequence.motions[1]
    maps.append(estimator.step(sequence.images[2], second))
    return [part for found in maps for part in (found.state.value, found.state.variance, found.state.cost)]


@pytest.mark.parametrize("anchored", [False, True], ids=["warped", "anchored"])
def test_the_map_does_not_depend_on_bands_or_threads(anchored: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    whole = run(anchored)
    monkeypatch.setattr(room, "ALONE", 0)
    for pixels, threads in ((1 << 9, 1), (1 << 11, 3), (1 << 12, 2)):
        monkeypatch.setattr(room, "PIXELS", pixels)
        monkeypatch.setattr(room, "_threads", lambda threads=threads: threads)
        room._pool.cache_clear()
        for one, other in zip(run(anchored), whole, strict=True):
            np.testing.assert_array_equal(one, other)
    room._pool.cache_clear()
