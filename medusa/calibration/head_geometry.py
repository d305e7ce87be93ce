"""The head's geometry from views of a board that is at rest while the joints move: pure estimation."""

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from medusa.kinematics import Eye, HeadGeometry, Joints, camera_pose
from perception.camera.errors import CameraCalibrationError

Array = NDArray[np.float64]
WORST_RESIDUAL = math.radians(0.3)
WORST_OFFSET_DEVIATION = 0.010
WORST_TURN_DEVIATION = math.radians(0.3)
LEAST_VIEWS = 8
_EYES: tuple[Eye, Eye] = ("left", "right")
_BASELINES = (0.060, 0.200)
_FREE = 19


class EyeView(NamedTuple):
    """Corners (n, 3) on the board [m] and their tangents (n, 2), lens distortion taken out."""

    points: Array
    tangents: Array


@dataclass(frozen=True, eq=False)
class HeadView:
    """The joint angles [rad] and what each eye saw of the board; None when it did not see it."""

    joints: Joints
    left: EyeView | None
    right: EyeView | None


@dataclass(frozen=True, eq=False)
class HeadCalibration:
    """What the views say about the head.

    geometry: baseline and optical centres [m]. turns: each camera's rotation vector [rad] from its own
    optical axes to those its joint means (x right, y down, z along the zero of the joint). residual,
    view_residuals: root mean square angle between where a corner is seen and where it should be [rad].
    Deviations are standard deviations of baseline and centres [m] and of the turns [rad].
    """

    geometry: HeadGeometry
    turns: dict[Eye, tuple[float, float, float]]
    residual: float
    view_residuals: tuple[float, ...]
    baseline_deviation: float
    centre_deviation: float
    turn_deviation: float


def estimate_head(views: Sequence[HeadView], *, baseline: float = 0.130) -> HeadCalibration:
    """Least squares over all corners for baseline, optical centres, camera turns and the board's pose.

    `baseline` [m] is where the search begins. Raises CameraCalibrationError when there are too few views, when the
    joints moved too little to tell the parameters apart, or when the residual is above 0.3°.
    """
    seen = [view for view in views if view.left is not None or view.right is not None]
    if len(seen) < LEAST_VIEWS:
        raise CameraCalibrationError(
            f"{len(seen)} views of the board are not enough, {LEAST_VIEWS} are needed"
        )
    for eye in _EYES:
        if not any(getattr(view, eye) is not None for view in seen):
            raise CameraCalibrationError(f"the {eye} eye never saw the board")
    state = np.zeros(_FREE)
    state[0] = baseline
    state[13:] = _first_board_pose(seen, baseline)
    state, residuals, jacobian = _least_squares(seen, state)
    residual = math.sqrt(float(residuals @ residuals) / (len(residuals) / 2))
    _check_residual(residual)
    deviations = _deviations(jacobian, residuals)
    offsets, turns = deviations[[1, 2, 3, 7, 8, 9]], deviations[[4, 5, 6, 10, 11, 12]]
    if not max(float(deviations[0]), float(offsets.max())) <= WORST_OFFSET_DEVIATION:
        raise CameraCalibrationError(
            f"the optical centres are uncertain by {1e3 * max(deviations[0], offsets.max()):.1f} mm (allowed: "
            f"{1e3 * WORST_OFFSET_DEVIATION:g} mm): move eyes, tilt and pan further, board nearer"
        )
    if not float(turns.max()) <= WORST_TURN_DEVIATION:
        raise CameraCalibrationError(
            f"the cameras' turns are uncertain by {math.degrees(turns.max()):.2f}° (allowed: "
            f"{math.degrees(WORST_TURN_DEVIATION):g}°): move tilt and eyes further"
        )
    if not _BASELINES[0] * 0.9 <= state[0] <= _BASELINES[1] * 1.1:
        raise CameraCalibrationError(
            f"a baseline of {1e3 * state[0]:.0f} mm came out, the head has {1e3 * _BASELINES[0]:.0f} to "
            f"{1e3 * _BASELINES[1]:.0f} mm: is the size of the board's squares right?"
        )
    per_view = []
    start = 0
    for view in seen:
        count = sum(2 * len(part.points) for part in (view.left, view.right) if part is not None)
        part_of = residuals[start : start + count]
        per_view.append(math.sqrt(float(part_of @ part_of) / (count / 2)))
        start += count
    return HeadCalibration(
        _geometry(state), {"left": _triple(state[4:7]), "right": _triple(state[10:13])}, residual,
        tuple(per_view), float(deviations[0]), float(offsets.max()), float(turns.max()),
    )  # fmt: skip


def turn_matrix(vector: Array | tuple[float, float, float]) -> Array:
    """Rotation matrix (3, 3) of a rotation vector [rad], Rodrigues."""
    x, y, z = (float(v) for v in vector)
    angle = math.sqrt(x * x + y * y + z * z)
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    turned: Array = np.eye(3) + cross
    if angle > 1e-12:
        cross /= angle
        turned = np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * (cross @ cross)
    return turned


def _triple(values: Array) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])


def _geometry(state: Array) -> HeadGeometry:
    return HeadGeometry(float(state[0]), _triple(state[1:4]), _triple(state[7:10]))


def _residuals(views: Sequence[HeadView], state: Array) -> Array:
    """Seen minus expected, as angles over the ray: (2 n,)."""
    geometry = _geometry(state)
    turns = {"left": turn_matrix(state[4:7]), "right": turn_matrix(state[10:13])}
    board, at = turn_matrix(state[13:16]), state[16:19]
    parts = []
    for view in views:
        for eye in _EYES:
            part: EyeView | None = getattr(view, eye)
            if part is None:
                continue
            rotation, centre = camera_pose(geometry, view.joints, eye)
            inside = (part.points @ board.T + at - centre) @ rotation @ turns[eye]
            expected = inside[:, :2] / np.maximum(inside[:, 2:], 1e-6)
            length = np.sqrt(1.0 + (part.tangents**2).sum(axis=1, keepdims=True))
            parts.append(((part.tangents - expected) / length).ravel())
    return np.concatenate(parts)


def _least_squares(views: Sequence[HeadView], state: Array) -> tuple[Array, Array, Array]:
    """Levenberg and Marquardt with a numerical Jacobian."""
    damping = 1e-3
    residuals = _residuals(views, state)
    jacobian = _jacobian(views, state, residuals)
    for _ in range(60):
        normal = jacobian.T @ jacobian
        scale = np.diag(np.maximum(np.diag(normal), 1e-9))
        step = np.linalg.solve(normal + damping * scale, -jacobian.T @ residuals)
        tried = _residuals(views, state + step)
        if tried @ tried < residuals @ residuals:
            gain = 1.0 - float(tried @ tried) / float(residuals @ residuals)
            state, residuals = state + step, tried
            jacobian = _jacobian(views, state, residuals)
            damping = max(damping / 5.0, 1e-9)
            if gain < 1e-9:
                break
        else:
            damping *= 4.0
            if damping > 1e6:
                break
    return state, residuals, jacobian


def _jacobian(views: Sequence[HeadView], state: Array, residuals: Array) -> Array:
    step = 1e-6
    return np.stack(
        [(_residuals(views, state + step * unit) - residuals) / step for unit in np.eye(len(state))], axis=1
    )


def _deviations(jacobian: Array, residuals: Array) -> Array:
    freedom = max(1, len(residuals) - jacobian.shape[1])
    # A floor for noiseless images: what cannot be distinguished must stay visible as such.
    variance = max(float(residuals @ residuals) / freedom, (1e-5) ** 2)
    normal = jacobian.T @ jacobian
    scale = np.sqrt(np.maximum(np.diag(normal), 1e-18))
    values, vectors = np.linalg.eigh(normal / np.outer(scale, scale))
    if values[0] < 1e-10 * values[-1]:
        raise CameraCalibrationError(
            "the views do not tell baseline, centres and turns apart: eyes, tilt and pan must all move"
        )
    inverse = (vectors / values) @ vectors.T / np.outer(scale, scale)
    deviations: Array = np.sqrt(variance * np.diag(inverse))
    return deviations


def _first_board_pose(views: Sequence[HeadView], baseline: float) -> Array:
    """The board's rotation vector and place in the head frame from the view with most corners, nominal head."""
    import cv2

    best = max(
        (
            (view.joints, eye, part)
            for view in views
            for eye in _EYES
            if (part := getattr(view, eye)) is not None
        ),
        key=lambda found: len(found[2].points),
    )
    joints, eye, part = best
    got, turn, place = cv2.solvePnP(part.points, part.tangents, np.eye(3), np.zeros(5))
    if not got:
        raise CameraCalibrationError("the board's pose cannot be found in the view with most corners")
    rotation, centre = camera_pose(HeadGeometry(baseline), joints, eye)
    pose = rotation @ turn_matrix(np.asarray(turn, float).ravel())
    vector, _ = cv2.Rodrigues(pose)
    return np.concatenate([vector.ravel(), rotation @ np.asarray(place, float).ravel() + centre])


def _check_residual(residual: float) -> None:
    if residual > WORST_RESIDUAL:
        raise CameraCalibrationError(
            f"corners are seen {math.degrees(residual):.2f}° from where the fitted head would see them, more "
            f"than {math.degrees(WORST_RESIDUAL):g}°: is every axis homed, its counts per radian right, and "
            "the board at rest?"
        )
