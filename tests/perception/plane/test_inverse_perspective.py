"""Inverse perspective (4.22)–(4.35) in its corrected form."""

import numpy as np
import pytest

from perception.plane.inverse_perspective import InversePerspective, height_of_ratio

FX, FY = 192.0, 256.0
RNG = np.random.default_rng(7)
X, Y = RNG.uniform(-120, 120, (2, 400))


def ground_flow(
    slope_x: float, slope_y: float, fx: float, fy: float, height: float = 0.0
) -> tuple[np.ndarray, np.ndarray]:
    """Exact flow (4.2), (4.3) of points `height`·H above Z = 1 + γ_x X + γ_y Y, the camera moving within the plane."""
    depth = (1 - height) / (1 - slope_x * X / fx - slope_y * Y / fy)
    # A direction in the plane: (0.3, 1, 0.3 γ_x + γ_y) is orthogonal to its normal (−γ_x, −γ_y, 1).
    tx, ty, tz = 0.3 * 0.05, 0.05, 0.05 * (0.3 * slope_x + slope_y)
    return (X * tz - fx * tx) / depth, (Y * tz - fy * ty) / depth


@pytest.mark.parametrize(("fx", "fy"), [(FX, FY), (1.0, 1.0)], ids=["true focal lengths", "virtual camera"])
def test_flow_of_the_floor_is_constant_seen_from_above(fx: float, fy: float) -> None:
    u, v = ground_flow(0.1, 1.0, FX, FY)
    view = InversePerspective.from_slopes(0.1 * fx / FX, 1.0 * fy / FY, fx, fy)
    above = view.project_flow(X, Y, u, v)
    for part in above:
        assert np.ptp(part) < 1e-9 * np.abs(part).max()


def test_a_slope_of_one_is_a_tilt_of_minus_45_degrees_and_undoes_the_pan() -> None:
    view = InversePerspective.from_slopes(0.0, 1.0)
    assert np.degrees(view.tilt) == pytest.approx(-45)
    # (4.31): the normal (−γ_x, −γ_y, 1) becomes vertical.
    slanted = InversePerspective.from_slopes(0.3, 0.8)
    up = slanted.rotation @ np.array([-0.3, -0.8, 1.0])
    assert up[:2] == pytest.approx([0, 0], abs=1e-12)
    assert slanted.rotation @ slanted.rotation.T == pytest.approx(np.eye(3))


def test_the_jacobian_is_that_of_the_projection() -> None:
    view = InversePerspective(-0.7, 0.1, FX, FY)
    step = 1e-4
    here, across = np.array(view.project(X, Y)), np.array(view.project(X + step, Y))
    down = np.array(view.project(X, Y + step))
    found = np.moveaxis(view.jacobian(X, Y), 0, -1)
    assert found[:, 0] == pytest.approx((across - here) / step, rel=1e-4, abs=1e-4)
    assert found[:, 1] == pytest.approx((down - here) / step, rel=1e-4, abs=1e-4)


@pytest.mark.parametrize("height", [0.0, 0.1, 0.4, -0.2])
def test_normal_flow_of_what_stands_higher_is_faster_by_one_over_one_less_its_height(height: float) -> None:
    angle = RNG.uniform(0, np.pi, X.size)
    normal = (np.cos(angle), np.sin(angle))
    view = InversePerspective.from_slopes(0.0, 1.0, FX, FY)
    floor = view.project_flow(X, Y, *ground_flow(0.0, 1.0, FX, FY))
    direction = np.array([floor[0][0], floor[1][0]])
    u, v = ground_flow(0.0, 1.0, FX, FY, height)
    ratio = view.ratio(X, Y, normal, normal[0] * u + normal[1] * v, direction)
    known = np.isfinite(ratio)
    # Normals within 11.5° of being across the motion say nothing: an eighth of all directions.
    assert 0.8 < known.mean() < 0.95
    assert ratio[known] == pytest.approx(1 / (1 - height), rel=1e-9)
    assert height_of_ratio(ratio[known]) == pytest.approx(height, abs=1e-9)


def test_projecting_normal_flow_on_the_motion_as_the_text_says_is_useless() -> None:
    angle = RNG.uniform(0, np.pi, X.size)
    normal = np.stack((np.cos(angle), np.sin(angle)))
    u, v = ground_flow(0.0, 1.0, FX, FY)
    view = InversePerspective.from_slopes(0.0, 1.0, FX, FY)
    floor = np.array(view.project_flow(X, Y, u, v))[:, 0]
    seen = np.array(view.project_flow(X, Y, *((normal[0] * u + normal[1] * v) * normal)))
    literal = floor @ seen / (floor @ floor)
    # The page of equations: .46 ± .37 where 1 is meant.
    assert literal.mean() == pytest.approx(0.46, abs=0.1)
    assert literal.std() == pytest.approx(0.37, abs=0.08)
