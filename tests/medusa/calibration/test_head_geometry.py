"""The head's geometry from a rendered board: baseline, optical centres and camera turns come out."""

from math import degrees, radians

import numpy as np
import pytest

from medusa.calibration.head_geometry import EyeView, HeadView, estimate_head, turn_matrix
from medusa.kinematics import HeadGeometry, Joints, camera_pose
from perception.camera.calibration import CalibrationBoard
from perception.camera.errors import CameraCalibrationError
from perception.camera.intrinsics import Intrinsics
from sim_devices.chain import HeadGeometry as Chain
from sim_devices.chain import Mount, optical_frame
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import facing, still
from sim_devices.worlds.render import render
from sim_devices.worlds.surface import Rectangle
from sim_devices.worlds.texture import Texture
from sim_devices.worlds.world import World

BOARD = CalibrationBoard()
OPTICS = Optics.centred_deg(256, 192, 45.0)
LENS = Intrinsics(256, 192, OPTICS.fx, OPTICS.fy, OPTICS.cx, OPTICS.cy)
TRUE = Chain(
    0.150,
    Mount((0.018, 0.003, -0.002), (radians(1.0), radians(-0.8), radians(1.5))),
    Mount((0.015, -0.004, 0.003), (radians(-0.5), radians(0.6), radians(-1.0))),
)
RNG = np.random.default_rng(7)
POSTURES = [Joints(*np.radians(RNG.uniform((-8, -6, -16, -2), (8, 6, 2, 16)))) for _ in range(14)]


def rendered_views(postures: list[Joints]) -> list[HeadView]:
    world = World(
        [Rectangle(*BOARD.size, Texture(BOARD.draw(48)), still(facing((0.6, 0.0, 0.0), 0.15, 0.1)))],
        sky=150.0,
    )
    views = []
    for joints in postures:
        eyes = []
        for side in ("left", "right"):
            picture = render(world, OPTICS, optical_frame(TRUE, side, joints.as_axes()), 0.0)  # type: ignore[arg-type]
            found = BOARD.find(np.clip(picture + 0.5, 0, 255).astype(np.uint8))
            eyes.append(None if found is None else EyeView(found.points, LENS.rays(found.pixels)))
        views.append(HeadView(joints, *eyes))
    return views


@pytest.fixture(scope="module")
def views() -> list[HeadView]:
    return rendered_views(POSTURES)


def test_baseline_centres_and_turns_come_out_of_rendered_boards(views: list[HeadView]) -> None:
    result = estimate_head(views)
    # Corners are found to about .1 px = .03 deg at 309 px of focal length; 14 postures of some 60 corners.
    assert degrees(result.residual) < 0.1
    assert result.geometry.baseline == pytest.approx(0.150, abs=0.002)
    assert result.geometry.left_centre == pytest.approx((0.018, 0.003, -0.002), abs=0.003)
    assert result.geometry.right_centre == pytest.approx((0.015, -0.004, 0.003), abs=0.003)
    for side, mount in (("left", TRUE.left), ("right", TRUE.right)):
        roll, pitch, yaw = mount.rotation
        # Roll about the optical axis, pitch down is about x to the left = -x, yaw left about up = -y.
        expected = (
            turn_matrix((-pitch, 0.0, 0.0)) @ turn_matrix((0.0, -yaw, 0.0)) @ turn_matrix((0.0, 0.0, roll))
        )
        error = turn_matrix(result.turns[side]).T @ expected  # type: ignore[index]
        assert degrees(np.arccos(min(1.0, (np.trace(error) - 1.0) / 2.0))) < 0.1
    assert 0.0 < result.baseline_deviation < 0.002
    assert len(result.view_residuals) == len(views)


def test_joints_that_did_not_stand_where_they_said_fail_above_the_bound(views: list[HeadView]) -> None:
    rng = np.random.default_rng(1)
    wrong = [
        HeadView(
            Joints(*(q + radians(1.5) * rng.standard_normal() for q in view.joints)), view.left, view.right
        )
        for view in views
    ]
    with pytest.raises(CameraCalibrationError, match=r"more than 0\.3°"):
        estimate_head(wrong)


def test_joints_that_did_not_move_cannot_tell_the_parameters_apart(views: list[HeadView]) -> None:
    geometry = HeadGeometry(0.150)
    grid = np.array([[x, y, 0.0] for x in (0.0, 0.1, 0.2) for y in (0.0, 0.1, 0.2)])
    place = np.array([1.0, 0.1, 0.1])
    turn = np.array([[0.0, 0.0, 1.0], [-1.0, 0.0, 0.0], [0.0, -1.0, 0.0]])
    still_views = []
    for _ in range(10):
        joints = Joints(0.0, 0.0, -0.05, 0.05)
        eyes = []
        for eye in ("left", "right"):
            rotation, centre = camera_pose(geometry, joints, eye)  # type: ignore[arg-type]
            inside = (grid @ turn.T + place - centre) @ rotation
            eyes.append(EyeView(grid, inside[:, :2] / inside[:, 2:]))
        still_views.append(HeadView(joints, *eyes))
    with pytest.raises(CameraCalibrationError, match=r"move|apart"):
        estimate_head(still_views)


def test_a_board_of_the_wrong_size_is_noticed(views: list[HeadView]) -> None:
    doubled = [
        HeadView(
            view.joints,
            *(
                None if part is None else EyeView(2.0 * part.points, part.tangents)
                for part in (view.left, view.right)
            ),
        )
        for view in views
    ]
    with pytest.raises(CameraCalibrationError, match="squares"):
        estimate_head(doubled)


def test_too_few_views_or_a_blind_eye_are_named(views: list[HeadView]) -> None:
    with pytest.raises(CameraCalibrationError, match=r"3 views.*8 are needed"):
        estimate_head(views[:3])
    blind = [HeadView(view.joints, view.left, None) for view in views]
    with pytest.raises(CameraCalibrationError, match="right eye never saw"):
        estimate_head(blind)
