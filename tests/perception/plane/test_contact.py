"""Contact, orientation and the plane in metres from homographies that are made of them."""

import cv2
import numpy as np
import pytest

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.plane.contact import estimate_contact
from perception.plane.errors import PlaneError
from perception.plane.metric_plane import MetricPlane, measure_plane, plane_homography
from perception.plane.plane_motion import PlaneMotion, from_delta, to_delta
from perception.plane.window import Window

CAMERA = Intrinsics(128, 128, 150.0, 140.0, 61.0, 66.0)
WINDOW = Window.central((128, 128), 80, 80)
INFORMATION = WINDOW.flow_products().sum(axis=0).reshape(8, 8) * 200
PLANE = np.array([-0.25, 0.15, 0.9])


def seen(homography: np.ndarray, error: np.ndarray | None = None) -> PlaneMotion:
    """A motion as the estimator gives it, of which an error δ has been made."""
    covariance = np.linalg.inv(INFORMATION)
    if error is not None:
        homography = homography @ WINDOW.to_pixels @ from_delta(error) @ WINDOW.from_pixels
    every = np.ones((WINDOW.rows, WINDOW.columns))
    return PlaneMotion(homography, WINDOW, covariance, INFORMATION, np.zeros(4), 1.0, 1.0, 1.0, every)


def turned(x: float, y: float, z: float) -> np.ndarray:
    return cv2.Rodrigues(np.array([x, y, z]))[0]


@pytest.mark.parametrize("scale", [1.0, -3.0, 0.2])
@pytest.mark.parametrize("steps", [100.0, 5.0, -30.0])
def test_time_to_contact_is_exact_whatever_the_scale_of_the_homography(scale: float, steps: float) -> None:
    # A camera that moves straight at a wall 1/.9 m ahead along its axis.
    motion = Motion(np.eye(3), np.array([0.0, 0.0, -1 / 0.9 / steps]))
    found = estimate_contact(seen(scale * plane_homography(CAMERA, motion, PLANE)), CAMERA)
    assert found.approach == pytest.approx(1 / steps, rel=1e-9)
    assert found.steps == (pytest.approx(steps - 1) if steps > 0 else float("inf"))
    assert found.slopes == pytest.approx((0.25 / 0.9, -0.15 / 0.9), rel=1e-9)


def test_a_known_rotation_is_taken_out() -> None:
    rotation = turned(0.02, -0.05, 0.03)
    motion = Motion(rotation, np.array([0.02, -0.01, -0.04]))
    found = estimate_contact(seen(plane_homography(CAMERA, motion, PLANE)), CAMERA, rotation)
    # D₂/D₁ = 1 + qᵀRᵀt: the distances of the plane from both camera centres.
    assert found.approach == pytest.approx(-float(PLANE @ rotation.T @ motion.translation), rel=1e-9)
    assert np.outer(found.direction, found.plane) == pytest.approx(
        np.outer(motion.translation, PLANE), abs=1e-9
    )


def test_deviations_of_contact_and_slopes_are_those_of_the_motion() -> None:
    rng = np.random.default_rng(5)
    motion = Motion(np.eye(3), np.array([0.01, 0.0, -0.06]))
    homography = plane_homography(CAMERA, motion, PLANE)
    true = -float(PLANE @ motion.translation)
    root = np.linalg.cholesky(np.linalg.inv(INFORMATION))
    off = []
    for _ in range(160):
        found = estimate_contact(seen(homography, root @ rng.normal(size=8)), CAMERA)
        off.append(
            (
                (found.approach - true) / found.approach_std,
                (found.slopes[0] - 0.25 / 0.9) / found.slopes_std[0],
            )
        )
    # 160 draws: the standard deviation of a standard deviation is 6 %.
    assert np.std(off, axis=0) == pytest.approx([1.0, 1.0], abs=0.17)


def test_the_plane_in_metres_is_exact_when_the_motion_is_known() -> None:
    motion = Motion(turned(0.03, 0.02, -0.04), np.array([0.05, 0.01, -0.08]))
    found = measure_plane(seen(-2.0 * plane_homography(CAMERA, motion, PLANE)), CAMERA, motion)
    assert found is not None
    assert found.q == pytest.approx(PLANE, rel=1e-8)
    assert found.distance == pytest.approx(1 / np.linalg.norm(PLANE))
    assert found.disagreement < 1e-6


def test_deviations_of_the_plane_are_those_of_the_motion_and_disagreement_is_near_one() -> None:
    rng = np.random.default_rng(6)
    motion = Motion(np.eye(3), np.array([0.0, 0.02, -0.05]))
    homography = plane_homography(CAMERA, motion, PLANE)
    root = np.linalg.cholesky(np.linalg.inv(INFORMATION))
    off, disagreements, distances = [], [], []
    for _ in range(160):
        found = measure_plane(seen(homography, root @ rng.normal(size=8)), CAMERA, motion)
        assert found is not None
        off.append((found.q - PLANE) / np.sqrt(np.diag(found.covariance)))
        distances.append((found.distance - 1 / np.linalg.norm(PLANE)) / found.distance_std)
        disagreements.append(found.disagreement)
    assert np.std(off, axis=0) == pytest.approx([1.0, 1.0, 1.0], abs=0.17)
    assert np.std(distances) == pytest.approx(1.0, abs=0.17)
    assert np.sqrt(np.mean(np.square(disagreements))) == pytest.approx(1.0, abs=0.12)


def test_a_wrong_rotation_is_seen_as_disagreement_and_a_wrong_speed_as_a_wrong_distance() -> None:
    motion = Motion(np.eye(3), np.array([0.0, 0.02, -0.05]))
    homography = plane_homography(CAMERA, motion, PLANE)
    turning = measure_plane(seen(homography), CAMERA, Motion(turned(0.0, 0.02, 0.01), motion.translation))
    faster = measure_plane(seen(homography), CAMERA, Motion(np.eye(3), 1.1 * motion.translation))
    assert turning is not None
    assert faster is not None
    assert turning.disagreement > 3
    assert faster.disagreement < 0.1
    assert faster.distance == pytest.approx(1.1 / np.linalg.norm(PLANE))


def test_a_camera_that_did_not_move_measures_no_distance() -> None:
    assert measure_plane(seen(np.eye(3)), CAMERA, Motion.identity()) is None


def test_a_carried_plane_is_the_plane_of_the_same_points() -> None:
    motion = Motion(turned(0.1, -0.2, 0.05), np.array([0.1, 0.05, -0.3]))
    plane = MetricPlane(PLANE, 1e-4 * np.diag([1.0, 2.0, 3.0]))
    rng = np.random.default_rng(1)
    points = rng.normal(size=(5, 3)) + np.array([0, 0, 3])
    points /= (points @ PLANE)[:, None]
    moved = points @ motion.rotation.T + motion.translation
    carried = plane.carried(motion)
    assert moved @ carried.q == pytest.approx(np.ones(5))
    # Covariance against finite differences.
    jacobian = np.stack(
        [
            (MetricPlane(PLANE + 1e-6 * unit, np.eye(3)).carried(motion).q - carried.q) / 1e-6
            for unit in np.eye(3)
        ],
        axis=1,
    )
    assert carried.covariance == pytest.approx(jacobian @ plane.covariance @ jacobian.T, rel=1e-4)


def test_two_measurements_of_a_plane_weigh_by_their_information() -> None:
    first = MetricPlane(np.array([0.0, 0.0, 1.0]), np.diag([1.0, 1.0, 1.0]))
    second = MetricPlane(np.array([0.0, 0.0, 2.0]), np.diag([1.0, 1.0, 0.25]))
    both = first.fused(second)
    assert both.q == pytest.approx([0, 0, 1.8])
    assert both.covariance[2, 2] == pytest.approx(0.2)


def test_planes_behind_and_motions_through_them_are_refused() -> None:
    with pytest.raises(PlaneError, match="above 0 m"):
        MetricPlane.at(np.array([0.0, 0.0, 1.0]), 0.0)
    with pytest.raises(PlaneError, match="through a plane"):
        MetricPlane.at(np.array([0.0, 0.0, 1.0]), 0.5).carried(Motion(np.eye(3), np.array([0.0, 0.0, -0.6])))


def test_delta_and_matrix_are_one_another() -> None:
    delta = np.arange(8) / 100
    assert to_delta(-4.0 * from_delta(delta)) == pytest.approx(delta)
