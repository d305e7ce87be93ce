"""Flow and inverse depth against points that are carried from one camera to the other by matrices."""

from math import cos, pi, radians, sin

import numpy as np
import pytest

from perception.flow.errors import MotionError
from perception.flow.geometry import CameraMotion, Mounting, Ray

FOCAL = 192.0


def pose(x, y, heading):
    """Body to world, 2-D: x forward, y left."""
    c, s = cos(heading), sin(heading)
    return np.array([[c, -s, x], [s, c, y], [0, 0, 1]])


def camera_in(body, mounting):
    """Camera to world: first axis to the right of the image, second along the optical axis."""
    c, s = cos(mounting.yaw_rad), sin(mounting.yaw_rad)
    return body @ np.array([[s, c, mounting.forward_m], [-c, s, mounting.left_m], [0, 0, 1]])


LEFT, RIGHT = Mounting(0.323, 0.105, pi / 2), Mounting(0.323, -0.105, -pi / 2)
ASKEW = Mounting(-0.2, 0.1, radians(50))
STEPS = [(0.02, 0.0, 0.0), (0.03, -0.01, 0.1), (-0.01, 0.004, -0.3), (0.0, 0.0, 0.05)]


@pytest.mark.parametrize("mounting", [LEFT, RIGHT, ASKEW])
@pytest.mark.parametrize("step", STEPS)
@pytest.mark.parametrize("x", [-0.3, 0.0, 0.17])
def test_the_flow_is_that_of_a_point_seen_from_both_places(mounting, step, x):
    later = camera_in(pose(*step), mounting)
    earlier = camera_in(pose(0, 0, 0), mounting)
    for depth in (0.2, 0.7, 5.0):
        seen = np.linalg.inv(earlier) @ later @ np.array([x * depth, depth, 1])
        expected = FOCAL * (x - seen[0] / seen[1])
        ray, motion = Ray(x, FOCAL), mounting.motion(*step)
        assert ray.predict_flow(1 / depth, motion)[0] == pytest.approx(expected, abs=1e-9)
        if abs(motion.right_m) > 1e-4:
            found, _ = ray.estimate_inverse_depth(expected, 0.1, motion)
            assert found == pytest.approx(1 / depth, abs=1e-9)


@pytest.mark.parametrize("step", STEPS)
def test_it_is_the_formula_that_sees_the_earlier_camera_s_point_from_the_later_one(step):
    """ρ = (cX + s − Q(c − sX))/(Q(s t_x − c t_z) + c t_x + s t_z) with X the earlier place, Q the later one."""
    motion = ASKEW.motion(*step)
    c, s = cos(motion.turn_rad), sin(motion.turn_rad)
    place, depth = -0.1, 0.8
    x, z = place * depth - motion.right_m, depth - motion.forward_m
    later = (c * x + s * z) / (c * z - s * x)
    lever = later * (s * motion.right_m - c * motion.forward_m) + c * motion.right_m + s * motion.forward_m
    assert (c * place + s - later * (c - s * place)) / lever == pytest.approx(1 / depth, rel=1e-9)
    found, _ = Ray(later, FOCAL).estimate_inverse_depth(FOCAL * (later - place), 0.1, motion)
    assert found == pytest.approx(1 / (c * z - s * x), rel=1e-9)


def test_a_left_camera_sees_the_wall_move_to_the_left_and_a_right_one_to_the_right():
    for mounting, sign in ((LEFT, -1), (RIGHT, 1)):
        motion = mounting.motion(0.08, 0.0, 0.0)
        assert motion.right_m == pytest.approx(-sign * 0.08)
        assert motion.forward_m == pytest.approx(0.0, abs=1e-12)
        # u = ∓ T_M/Z, thesis (3.9) without rotation.
        assert Ray(0.0, FOCAL).predict_flow(2.0, motion)[0] == pytest.approx(sign * 2.0 * 0.08 * FOCAL)


def test_a_turn_to_the_left_moves_all_to_the_right_by_1_plus_x_squared():
    """+(1 + x²) θ̇ on both sides, where the thesis prints a minus (equations.md §0)."""
    for x in (-0.3, 0.0, 0.3):
        for mounting in (LEFT, RIGHT):
            flow, parallax = Ray(x, FOCAL).predict_flow(0.0, mounting.motion(0.0, 0.0, 1e-4))
            assert flow == pytest.approx(FOCAL * (1 + x * x) * 1e-4, rel=1e-3)
            assert parallax == 0.0


def test_the_lever_of_the_mounting_is_the_thesis_s():
    """θ̇ ρ cos θ and θ̇ ρ sin θ of (3.9): ρ .34 m, θ 72°."""
    motion = RIGHT.motion(0.0, 0.0, 1e-5)
    assert motion.right_m == pytest.approx(-0.34 * cos(radians(72)) * 1e-5, rel=2e-3)
    assert motion.forward_m == pytest.approx(-0.34 * sin(radians(72)) * 1e-5, rel=2e-3)


def test_motions_are_joined_and_parted_like_matrices():
    first, second = (
        CameraMotion(0.1, -0.2, 0.5, 0.003, 0.0, 0.01),
        CameraMotion(0.04, 0.3, -1.1, 0.004, 0.002, 0.0),
    )

    def matrix(motion):
        c, s = cos(motion.turn_rad), sin(motion.turn_rad)
        return np.array([[c, -s, motion.right_m], [s, c, motion.forward_m], [0, 0, 1]])

    whole = first.then(second)
    assert matrix(whole) == pytest.approx(matrix(first) @ matrix(second))
    assert whole.right_deviation_m == pytest.approx(0.005)
    again = whole.since(first)
    assert matrix(again) == pytest.approx(matrix(second))
    deviations = (again.right_deviation_m, again.forward_deviation_m, again.turn_deviation_rad)
    assert deviations == pytest.approx((0.004, 0.002, 0.0), abs=1e-9)


def test_the_deviation_is_how_far_small_errors_move_the_inverse_depth():
    ray, motion = Ray(0.1, FOCAL), CameraMotion(0.02, 0.004, 0.03, 1e-4, 2e-4, 3e-4)
    flow, _ = ray.predict_flow(1.6, motion)
    _, deviation = ray.estimate_inverse_depth(flow, 0.05, motion)
    random = np.random.default_rng(0)
    values = []
    for _ in range(4000):
        right, forward, turn = random.normal((0.02, 0.004, 0.03), (1e-4, 2e-4, 3e-4))
        moved = CameraMotion(right, forward, turn)
        values.append(ray.estimate_inverse_depth(flow + random.normal(0, 0.05), 0.0, moved)[0])
    # 4000 draws know a deviation to 1.1 %; twice that and the curvature.
    assert deviation == pytest.approx(np.std(values), rel=0.03)


def test_the_mounting_passes_the_body_s_deviations_on():
    random = np.random.default_rng(0)
    stated = ASKEW.motion(0.02, 0.001, 0.03, (1e-4, 2e-4, 5e-4))
    drawn = [ASKEW.motion(*random.normal((0.02, 0.001, 0.03), (1e-4, 2e-4, 5e-4))) for _ in range(4000)]
    for name in ("right_m", "forward_m", "turn_rad"):
        deviation = getattr(stated, name.replace("_m", "_deviation_m").replace("_rad", "_deviation_rad"))
        assert deviation == pytest.approx(np.std([getattr(m, name) for m in drawn]), rel=0.05)


def test_without_parallax_there_is_no_distance_but_nan():
    value, deviation = Ray(0.0, FOCAL).estimate_inverse_depth(3.0, 0.1, CameraMotion(0.0, 0.0, 0.02))
    assert np.isnan(value)
    assert np.isnan(deviation)


@pytest.mark.parametrize(
    "motion",
    [CameraMotion(float("nan"), 0, 0), CameraMotion(0, float("inf"), 0), CameraMotion(0, 0, 0, -1e-3)],
)
def test_a_motion_that_is_no_motion_is_refused(motion):
    with pytest.raises(MotionError):
        motion.check()
