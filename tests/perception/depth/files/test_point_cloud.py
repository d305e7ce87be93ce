"""The cloud's bytes, read back by hand."""

from pathlib import Path

import numpy as np

from perception.depth.files.point_cloud import write_ply
from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.pinhole import Pinhole

CAMERA = Pinhole(100.0, 50.0, 1.0, 0.0)
VERTEX = np.dtype("<f4,<f4,<f4,u1,u1,u1")


def _state() -> InverseDepth:
    # One known pixel, one behind the camera, one unknown, one whose σ_Z/Z is 0.5.
    value = np.array([[0.5, -1.0, np.nan, 0.5]], np.float32)
    return InverseDepth(
        value, np.array([[1e-6, 1e-6, np.nan, 0.0625]], np.float32), np.zeros((1, 4), np.float32)
    )


def _body(path: Path) -> tuple[str, np.ndarray]:
    header, body = path.read_bytes().split(b"end_header\n", 1)
    return header.decode("ascii"), np.frombuffer(body, VERTEX)


def test_a_point_stands_where_the_pinhole_says_with_its_colour(tmp_path: Path) -> None:
    image = np.arange(12, dtype=np.uint8).reshape(1, 4, 3)
    assert write_ply(tmp_path / "c.ply", CAMERA, _state(), image) == 1
    header, points = _body(tmp_path / "c.ply")
    assert header.startswith("ply\nformat binary_little_endian 1.0\nelement vertex 1\n")
    # Z = 2 m at column 0: x = (0 − 1)/100·2; blue, green, red 0, 1, 2 in the image.
    np.testing.assert_allclose(list(points[0])[:3], [-0.02, 0.0, 2.0], rtol=1e-6)
    assert list(points[0])[3:] == [2, 1, 0]


def test_uncertain_points_are_left_out_by_default(tmp_path: Path) -> None:
    image = np.full((1, 4), 9, np.uint8)
    assert write_ply(tmp_path / "c.ply", CAMERA, _state(), image, uncertainty=0.6) == 2
    assert list(_body(tmp_path / "c.ply")[1][1])[3:] == [9, 9, 9]
