"""Intrinsics from rendered boards: the camera that took the images comes out."""

from math import radians

import numpy as np
import pytest

from perception.camera.calibration import BoardView, CalibrationBoard, estimate_intrinsics
from perception.camera.errors import CameraCalibrationError
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import Placement, facing, rotation_about, still
from sim_devices.worlds.render import render
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.world import World

BOARD = CalibrationBoard()
OPTICS = Optics(320, 240, 330.0, 333.0, 163.2, 117.4)
TURNS = [(20, 0), (-20, 5), (0, 25), (5, -25), (25, 20), (-25, -15), (15, -20), (-12, 22)]


def view(yaw_deg: float, pitch_deg: float, noise: float = 0.0, seed: int = 0) -> BoardView | None:
    turn = Placement(rotation_about(1, radians(yaw_deg)) @ rotation_about(0, radians(pitch_deg)))
    place = facing((0.5, 0.03 * np.sin(yaw_deg), 0.03 * np.cos(pitch_deg)))
    world = World([Rectangle(*BOARD.size, Texture(BOARD.draw(64)), still(place @ turn))], sky=160.0)
    image = render(world, OPTICS, facing((0.0, 0.0, 0.0)), 0.0)
    image = image + noise * np.random.default_rng(seed).standard_normal(image.shape)
    return BOARD.find(np.clip(image, 0, 255).astype(np.uint8))


def views(noise: float = 0.0) -> list[BoardView]:
    found = [view(*turn, noise, k) for k, turn in enumerate(TURNS)]
    return [each for each in found if each is not None]


def test_the_rendered_camera_comes_out_of_its_images() -> None:
    seen = views(noise=2.0)
    assert len(seen) == len(TURNS)
    result = estimate_intrinsics(seen, 320, 240)
    # Eight views of 35 corners, each found to about .1 px, know a focal length to a few tenths of a per cent.
    assert result.intrinsics.fx == pytest.approx(330.0, rel=0.01)
    assert result.intrinsics.fy == pytest.approx(333.0, rel=0.01)
    assert result.intrinsics.cx == pytest.approx(163.2, abs=2.0)
    assert result.intrinsics.cy == pytest.approx(117.4, abs=2.0)
    assert result.residual_px < 0.3
    assert len(result.view_residuals_px) == len(TURNS)


def test_corners_are_numbered_in_metres_on_the_board() -> None:
    seen = view(0.0, 0.0)
    assert seen is not None
    assert seen.points.shape == (35, 3)
    assert seen.points[:, :2].max(axis=0) == pytest.approx([7 * 0.04, 5 * 0.04])


def test_too_few_views_are_refused_with_both_numbers() -> None:
    with pytest.raises(CameraCalibrationError, match=r"2 views.*6 are needed"):
        estimate_intrinsics(views()[:2], 320, 240)


def test_a_board_that_was_only_seen_squarely_is_refused() -> None:
    flat = [view(0.01 * k, 0.0, 1.0, k) for k in range(8)]
    with pytest.raises(CameraCalibrationError, match="turn the board"):
        estimate_intrinsics([each for each in flat if each is not None], 320, 240)


def test_a_image_without_a_board_shows_none() -> None:
    assert BOARD.find(np.full((240, 320), 90, np.uint8)) is None


@pytest.mark.parametrize(
    ("board", "message"),
    [({"columns": 2}, "2 x 6"), ({"marker": 0.05}, "0.05 m"), ({"dictionary": "DICT_9X9"}, "DICT_9X9")],
)
def test_an_impossible_board_is_refused(board: dict[str, object], message: str) -> None:
    with pytest.raises(CameraCalibrationError, match=message):
        CalibrationBoard(**board)  # type: ignore[arg-type]
