"""Which images make a sequence, and the errors of those that cannot."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.errors import ImageError
from perception.depth.files.sequence import list_images, read_image

GREY = np.arange(48, dtype=np.uint8).reshape(6, 8)


def _store(folder: Path, *names: str) -> Path:
    folder.mkdir(parents=True, exist_ok=True)
    for name in names:
        assert cv2.imwrite(str(folder / name), GREY)
    return folder


def test_a_folder_gives_its_images_in_the_order_of_their_names(tmp_path: Path) -> None:
    folder = _store(tmp_path, "b.png", "a.pgm", "c.PNG")
    (folder / "notes.md").write_text("no image")
    assert [path.name for path in list_images(folder)] == ["a.pgm", "b.png", "c.PNG"]


def test_a_recording_of_tum_gives_its_colour_images(tmp_path: Path) -> None:
    _store(tmp_path / "rgb", "1.5.png", "2.5.png")
    assert [path.name for path in list_images(tmp_path)] == ["1.5.png", "2.5.png"]


def test_a_pattern_leaves_other_images_of_the_folder_out(tmp_path: Path) -> None:
    folder = _store(tmp_path, "view2.png", "view1.png", "truth.png")
    assert [path.name for path in list_images(folder / "view*.png")] == ["view1.png", "view2.png"]


@pytest.mark.parametrize("lines", ["b.png\na.png\n", "# time file\n1.0 b.png\n\n2.0 a.png\n"])
def test_a_list_keeps_its_own_order_with_or_without_times(tmp_path: Path, lines: str) -> None:
    index = _store(tmp_path, "a.png", "b.png") / "order.txt"
    index.write_text(lines)
    assert [path.name for path in list_images(index)] == ["b.png", "a.png"]


def test_a_image_that_a_list_names_and_that_is_not_there_is_named(tmp_path: Path) -> None:
    index = _store(tmp_path, "a.png") / "order.txt"
    index.write_text("a.png\nlost.png\n")
    with pytest.raises(ImageError, match=r"lost\.png does not exist"):
        list_images(index)


def test_a_list_that_is_no_text_is_refused(tmp_path: Path) -> None:
    (tmp_path / "order.txt").write_bytes(b"\xff\xfe\x80")
    with pytest.raises(ImageError, match="cannot be read"):
        list_images(tmp_path / "order.txt")


def test_one_image_is_too_few(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="1 images; depth from motion needs two or more"):
        list_images(_store(tmp_path, "a.png"))


def test_what_is_no_sequence_is_said(tmp_path: Path) -> None:
    with pytest.raises(ImageError, match="neither a folder"):
        list_images(tmp_path / "nowhere")


def test_grey_stays_grey_and_transparency_is_dropped(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "grey.png"), GREY)
    cv2.imwrite(str(tmp_path / "clear.png"), np.dstack([GREY, GREY + 1, GREY + 2, GREY]))
    np.testing.assert_array_equal(read_image(tmp_path / "grey.png"), GREY)
    np.testing.assert_array_equal(read_image(tmp_path / "clear.png"), np.dstack([GREY, GREY + 1, GREY + 2]))


def test_what_is_no_image_is_named(tmp_path: Path) -> None:
    (tmp_path / "torn.png").write_bytes(b"\x89PNG\r\n\x1a\n")
    with pytest.raises(ImageError, match=r"torn\.png: cannot be read as an image"):
        read_image(tmp_path / "torn.png")


def test_sixteen_bits_a_channel_are_refused(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "deep.png"), GREY.astype(np.uint16))
    with pytest.raises(ImageError, match="16 bits a channel, 8 are needed"):
        read_image(tmp_path / "deep.png")
