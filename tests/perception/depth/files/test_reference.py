"""Ground truth of three kinds, and the figures of a map against it."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.errors import OptionError
from perception.depth.files.reference import read_reference
from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.program.accuracy import compare


def test_a_depth_image_of_tum_holds_fifths_of_millimetres(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.png"), np.array([[10000, 0]], np.uint16))
    # 10000 / 5000 = 2 m.
    np.testing.assert_array_equal(read_reference(tmp_path / "d.png", 5000, None), np.float32([[0.5, np.nan]]))


def test_a_disparity_image_of_middlebury_holds_sixteenths_of_pixels(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "d.pgm"), np.array([[160, 0]], np.uint8))
    # 10 px over focal length 400 px times baseline 0.1 m: 0.25 per metre.
    np.testing.assert_array_equal(read_reference(tmp_path / "d.pgm", 16, 40), np.float32([[0.25, np.nan]]))


def test_own_arrays_are_depths_in_metres(tmp_path: Path) -> None:
    depth = np.array([[4.0, np.nan, np.inf]], np.float32)
    np.save(tmp_path / "d.npy", depth)
    np.savez(tmp_path / "d.npz", depth=depth, std=depth)
    for name in ("d.npy", "d.npz"):
        truth = read_reference(tmp_path / name, 1.0, None)
        np.testing.assert_array_equal(truth, np.float32([[0.25, np.nan, np.nan]]))


@pytest.mark.parametrize("name", ["torn.npy", "torn.npz", "torn.png", "none.pgm"])
def test_what_cannot_be_read_is_named(tmp_path: Path, name: str) -> None:
    if name.startswith("torn"):
        (tmp_path / name).write_bytes(b"PK\x03\x04 torn")
    with pytest.raises(OptionError, match=name):
        read_reference(tmp_path / name, 1.0, None)


def test_an_archive_without_a_depth_is_refused(tmp_path: Path) -> None:
    np.savez(tmp_path / "d.npz", a=np.ones((1, 1)), b=np.ones((1, 1)))
    with pytest.raises(OptionError, match="depth"):
        read_reference(tmp_path / "d.npz", 1.0, None)


@pytest.mark.parametrize(("scale", "worth"), [(0.0, None), (-1.0, None), (1.0, 0.0), (float("nan"), None)])
def test_a_scale_that_is_not_positive_is_refused(tmp_path: Path, scale: float, worth: float | None) -> None:
    np.save(tmp_path / "d.npy", np.ones((1, 1)))
    with pytest.raises(OptionError, match="above 0 is needed"):
        read_reference(tmp_path / "d.npy", scale, worth)


def test_the_figures_are_those_counted_by_hand() -> None:
    # True disparity 10 px everywhere (100 px per 1/m); one pixel has no truth, one no estimate.
    truth = np.float32([[0.1, 0.1, 0.1, 0.1, np.nan]])
    value = np.float32([[0.1, 0.1125, 0.125, np.nan, 7.0]])
    state = InverseDepth(value, np.full((1, 5), 0.01**2, np.float32), np.zeros((1, 5), np.float32))
    figures = compare(state, truth, 100.0)
    assert figures.density == 0.75
    # Wrong by 0, 1.25, 2.5 px and missing.
    assert (figures.bad_1, figures.bad_2) == (0.75, 0.5)
    # |Z/Z₀ − 1| is 0, 1/9, 1/5 and infinite: the median is the mean of the middle two. 1e-5: single precision.
    assert figures.median_relative == pytest.approx((1 / 9 + 1 / 5) / 2, rel=1e-5)
    # Errors of 0, 1.25 and 2.5 stated deviations.
    assert figures.inside_68 == pytest.approx(1 / 3)
    assert figures.inside_95 == pytest.approx(2 / 3)


def test_a_reference_of_another_size_or_without_depth_is_refused() -> None:
    state = InverseDepth.unknown((2, 3))
    with pytest.raises(ValueError, match="4×2 pixels"):
        compare(state, np.ones((2, 4), np.float32))
    with pytest.raises(ValueError, match="holds no depth"):
        compare(state, np.full((2, 3), np.nan, np.float32))
