"""Motion files: steps, TUM and KITTI poses, and what is wrong with them."""

import math
from pathlib import Path

import numpy as np
import pytest

from perception.camera.motion import Motion
from perception.depth.errors import MotionError
from perception.depth.files.motion_file import read_poses

HEADER = "tx,ty,tz,wx,wy,wz\n"
TIMED = [Path("1.000.png"), Path("1.010.png"), Path("1.020.png")]
STILL = "0 0 0 0 0 0 1"


def _file(folder: Path, name: str, text: str) -> Path:
    (folder / name).write_text(text)
    return folder / name


def test_a_step_to_the_right_moves_what_is_seen_to_the_left(tmp_path: Path) -> None:
    poses = read_poses(_file(tmp_path, "m.csv", HEADER + "0.1,0,0,0,0,0\n"), TIMED[:2])
    # The camera goes +0.1 m along x, so a point of the first frame has x smaller by that in the second.
    np.testing.assert_allclose(Motion.between(*poses).translation, [-0.1, 0, 0])


def test_a_step_after_a_turn_is_in_the_turned_frame(tmp_path: Path) -> None:
    quarter = np.pi / 2
    rows = f"0,0,0,0,{quarter!r},0\n0,0,1,0,0,0\n"
    poses = read_poses(_file(tmp_path, "m.csv", HEADER + rows), TIMED)
    # Turned by 90° about y (down), z forward has become x of the first frame; 1e-12: rounding alone.
    np.testing.assert_allclose(poses[2][:3, 3], [1, 0, 0], atol=1e-12)


def test_columns_may_stand_in_any_order_and_others_are_ignored(tmp_path: Path) -> None:
    text = "\ufeffpicture, wx,wy,wz,tz,ty,tx\n01.png,0,0,0,3,2,1\n"
    poses = read_poses(_file(tmp_path, "m.csv", text), TIMED[:2])
    np.testing.assert_array_equal(poses[1][:3, 3], [1, 2, 3])


def test_tum_poses_are_interpolated_at_the_time_of_the_image(tmp_path: Path) -> None:
    half = math.sin(0.05), math.cos(0.05)
    text = f"# t x y z q\n1.000 {STILL}\n1.020 0.2 0 0 0 0 {half[0]!r} {half[1]!r}\n"
    poses = read_poses(_file(tmp_path, "g.txt", text), TIMED)
    np.testing.assert_allclose(poses[1][:3, 3], [0.1, 0, 0])
    # A turn of 0.1 rad about z, half of it half-way: exact by symmetry.
    np.testing.assert_allclose(poses[1][:2, 0], [np.cos(0.05), np.sin(0.05)])
    np.testing.assert_array_equal(poses[0], np.eye(4))


def test_a_quaternion_and_its_negative_are_one_rotation(tmp_path: Path) -> None:
    text = f"1.000 {STILL}\n1.020 0 0 0 0 0 0 -1\n"
    np.testing.assert_allclose(read_poses(_file(tmp_path, "g.txt", text), TIMED)[1], np.eye(4))


def test_kitti_rows_are_the_poses(tmp_path: Path) -> None:
    text = "1 0 0 0 0 1 0 0 0 0 1 0\n1 0 0 0.5 0 1 0 0 0 0 1 2\n"
    poses = read_poses(_file(tmp_path, "p.txt", text), TIMED[:2])
    np.testing.assert_array_equal(poses[1][:3, 3], [0.5, 0, 2])


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.csv", HEADER + "0,0,0,0,0,0\n", "1 rows for 3 images; 2 are needed"),
        ("m.csv", HEADER + "0,0,0,0,0,0\n0,0,0\n", "line 3: a number is missing or wrong"),
        ("m.csv", HEADER + "0,0,0,0,0,0\n0,nan,0,0,0,0\n", "line 3: holds a value that is no number"),
        ("m.csv", "tx,ty,tz\n1,2,3\n", "column 'wx' is missing"),
        ("g.txt", f"1.0 {STILL}\n1.02 0 0 0 0 0 0 0.7\n", "quaternion at 1.020000 has length 0.7"),
        ("g.txt", f"1.0 {STILL}\n1.015 {STILL}\n", r"no pose at the time of 1\.020\.png"),
        ("g.txt", f"0.9 {STILL}\n1.2 {STILL}\n", r"0\.30 s without a pose around 1\.000\.png, at most 0\.2"),
        ("g.txt", f"1.0 {STILL}\n1.02 0 0 0\n", "line 2: 4 numbers, 8 are needed"),
        ("p.txt", "1 0 0 0 0 1 0 0 0 0 1 0\n", "1 poses for 3 images"),
        ("p.txt", "2 0 0 0 0 1 0 0 0 0 1 0\n" * 3, "pose 1: its 3×3 part is no rotation"),
        ("p.txt", "1 0 0 0 0 1 0 0 0 0 -1 0\n" * 3, "pose 1: its 3×3 part is no rotation"),
        ("p.txt", "hello\n", "neither CSV nor lines of 8"),
        ("p.txt", "", "neither CSV nor lines of 8"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line_that_names_it(
    tmp_path: Path, name: str, text: str, message: str
) -> None:
    with pytest.raises(MotionError, match=message) as refused:
        read_poses(_file(tmp_path, name, text), TIMED)
    assert str(refused.value).startswith(str(tmp_path / name))
    assert "\n" not in str(refused.value)


def test_images_without_times_in_their_names_have_no_tum_poses(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match=r"left\.png: its name is no time"):
        read_poses(_file(tmp_path, "g.txt", f"1 {STILL}\n2 {STILL}\n"), [Path("left.png"), Path("1.png")])


def test_a_missing_file_is_said(tmp_path: Path) -> None:
    with pytest.raises(MotionError, match="cannot be read"):
        read_poses(tmp_path / "none.csv", TIMED)
