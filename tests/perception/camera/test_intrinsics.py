"""Intrinsics: files with named mistakes, rays, distortion against OpenCV's own projection."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.camera.errors import IntrinsicsError
from perception.camera.intrinsics import Intrinsics, format_intrinsics, load_intrinsics

LENS = Intrinsics(640, 480, 500.0, 510.0, 321.5, 238.25, (-0.2, 0.05, 0.001, -0.002, 0.0))


def test_a_file_read_back_gives_the_same_numbers(tmp_path: Path) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text(format_intrinsics(LENS, "left") + format_intrinsics(LENS.scaled(320, 240), "right"))
    assert load_intrinsics(path, "left") == LENS
    assert load_intrinsics(path, "right").width == 320


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "width = 640\nheight = 480\nfx = 'x'\nfy = 1.0\ncx = 1.0\ncy = 1.0\n",
            "fx must be a number, not 'x'",
        ),
        ("width = 640\nheight = 480\nfx = -3.0\nfy = 1.0\ncx = 1.0\ncy = 1.0\n", "-3.0"),
        ("width = 640\nfx = 1.0\nfy = 1.0\ncx = 1.0\ncy = 1.0\n", "height must be a number, not None"),
        (
            "width = 64.5\nheight = 4\nfx = 1.0\nfy = 1.0\ncx = 1.0\ncy = 1.0\n",
            "whole number of pixels, not 64.5",
        ),
        ("width = 4\nheight = 4\nfx = 1.0\nfy = 1.0\ncx = nan\ncy = 1.0\n", "finite"),
        (
            "width = 4\nheight = 4\nfx = 1.0\nfy = 1.0\ncx = 1.0\ncy = 1.0\ndistortion = [1.0]\n",
            "five numbers",
        ),
        ("width = = 4", "cameras.toml"),
    ],
)
def test_a_mistake_in_the_file_is_named(tmp_path: Path, text: str, message: str) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text(text)
    with pytest.raises(IntrinsicsError, match=message):
        load_intrinsics(path)


def test_a_missing_file_or_table_is_named(tmp_path: Path) -> None:
    with pytest.raises(IntrinsicsError, match=r"none\.toml"):
        load_intrinsics(tmp_path / "none.toml")
    (tmp_path / "a.toml").write_text("")
    with pytest.raises(IntrinsicsError, match=r"\[left\] is missing"):
        load_intrinsics(tmp_path / "a.toml", "left")


def test_rays_undo_what_the_lens_did() -> None:
    points = np.array([[0.1, -0.2, 1.0], [-0.3, 0.25, 1.0], [0.0, 0.0, 1.0]])
    pixels, _ = cv2.projectPoints(points, np.zeros(3), np.zeros(3), LENS.matrix, np.array(LENS.distortion))
    rays = LENS.rays(pixels[:, 0])
    # OpenCV inverts the distortion by a few fixed-point steps; 1e-4 of a focal length is .05 px.
    assert rays == pytest.approx(points[:, :2], abs=1e-4)


def test_an_unseen_pixel_has_no_ray() -> None:
    assert np.isnan(LENS.rays(np.array([np.nan, 3.0])))[0]
    plain = Intrinsics(64, 64, 80.0, 80.0, 31.5, 31.5)
    assert np.isnan(plain.rays(np.array([np.nan, np.nan]))).all()


def test_an_undistorted_image_shows_straight_lines() -> None:
    board = np.zeros((480, 640), np.uint8)
    rows, columns = np.mgrid[0:480, 0:640]
    rays = LENS.rays(np.stack([columns, rows], axis=-1).reshape(-1, 2).astype(float)).reshape(480, 640, 2)
    board[rays[..., 1] > 0.3] = 255  # seen through the lens: everything below a straight line in the world
    straight = LENS.undistort(board)
    edge = np.array([np.argmax(straight[:, c] > 127) for c in range(20, 620)])
    # The line Y/Z = .3 is on row fy .3 + cy = 391.25 of the undistorted image.
    assert np.abs(edge - 391.25).max() <= 1.5


def test_a_image_of_another_size_is_refused() -> None:
    with pytest.raises(IntrinsicsError, match=r"640 x 480.*32 x 24"):
        LENS.undistort(np.zeros((24, 32), np.uint8))


def test_a_subsampled_image_keeps_its_directions() -> None:
    small = LENS.scaled(80, 60)
    # The middle of the first 8 x 8 block is pixel 3.5 of the large image and pixel 0 of the small one.
    plain, half = (
        Intrinsics(640, 480, 500.0, 510.0, 321.5, 238.25),
        Intrinsics(**{**vars(small), "distortion": (0.0,) * 5}),
    )
    assert half.rays(np.zeros(2)) == pytest.approx(plain.rays(np.full(2, 3.5)))
