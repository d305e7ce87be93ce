"""Files of the camera's motion: steps in CSV, poses as TUM RGB-D or KITTI write them."""

import csv
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.depth.errors import MotionError

Matrix = NDArray[np.float64]
STEP_COLUMNS = ("tx", "ty", "tz", "wx", "wy", "wz")
FORMATS = ("auto", "csv", "tum", "kitti")
LONGEST_GAP_S = 0.2
"""Poses farther apart than this are not interpolated."""
UNIT_LENGTH = 0.02
"""A quaternion whose length is farther from 1 than this is no rotation; rounding to two decimals stays below."""


def read_poses(path: Path, images: list[Path], kind: str = "auto") -> list[Matrix]:
    """The 4×4 camera-to-world pose of every image, metres.

    - csv: columns tx ty tz (m) and wx wy wz (rotation vector, rad), the camera's step from the image before,
      in that image's camera frame; one row for every image after the first.
    - tum: lines `time tx ty tz qx qy qz qw`; an image's time is its file name, poses are interpolated.
    - kitti: lines of 12 numbers, the upper three rows of the pose; one line for every image.

    Args:
        images: paths; their names are times where the poses have times.
        kind: one of FORMATS.

    Raises:
        MotionError: what is wrong, and in which file and line.
    """
    try:
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        raise MotionError(f"{path}: cannot be read ({error})") from error
    if kind == "auto":
        kind = _guess(path, text)
    if kind == "csv":
        return _from_steps(path, text, len(images))
    rows = _numbers(path, text, 8 if kind == "tum" else 12)
    return _from_tum(path, rows, images) if kind == "tum" else _from_kitti(path, rows, len(images))


def _guess(path: Path, text: str) -> str:
    if path.suffix.lower() == ".csv":
        return "csv"
    for line in text.splitlines():
        fields = line.split()
        if fields and not line.startswith("#"):
            if len(fields) in (8, 12):
                return "tum" if len(fields) == 8 else "kitti"
            break
    raise MotionError(f"{path}: neither CSV nor lines of 8 (TUM) or 12 (KITTI) numbers")


def _numbers(path: Path, text: str, count: int) -> Matrix:
    rows = []
    for number, line in enumerate(text.splitlines(), 1):
        fields = line.replace(",", " ").split()
        if not fields or line.startswith("#"):
            continue
        try:
            values = [float(field) for field in fields]
        except ValueError as error:
            raise MotionError(f"{path}, line {number}: {error}") from error
        if len(values) != count:
            raise MotionError(f"{path}, line {number}: {len(values)} numbers, {count} are needed")
        if not np.isfinite(values).all():
            raise MotionError(f"{path}, line {number}: holds a value that is no number")
        rows.append(values)
    if not rows:
        raise MotionError(f"{path}: holds no motion")
    return np.array(rows)


def _from_steps(path: Path, text: str, images: int) -> list[Matrix]:
    reader = csv.DictReader(text.splitlines())
    names = [name.strip() for name in reader.fieldnames or []]
    missing = [name for name in STEP_COLUMNS if name not in names]
    if missing:
        raise MotionError(f"{path}: column {missing[0]!r} is missing; {' '.join(STEP_COLUMNS)} are needed")
    poses = [np.eye(4)]
    for number, row in enumerate(reader, 2):
        cells = {(name or "").strip(): value for name, value in row.items()}
        try:
            values = [float(cells[name]) for name in STEP_COLUMNS]
        except (TypeError, ValueError) as error:
            raise MotionError(f"{path}, line {number}: a number is missing or wrong ({error})") from error
        if not np.isfinite(values).all():
            raise MotionError(f"{path}, line {number}: holds a value that is no number")
        step = np.eye(4)
        step[:3, :3] = cv2.Rodrigues(np.array(values[3:]))[0]
        step[:3, 3] = values[:3]
        poses.append(poses[-1] @ step)
    if len(poses) != images:
        raise MotionError(
            f"{path}: {len(poses) - 1} rows for {images} images; {images - 1} are needed,"
            " one for every image after the first"
        )
    return poses


def _from_kitti(path: Path, rows: Matrix, images: int) -> list[Matrix]:
    if len(rows) != images:
        raise MotionError(f"{path}: {len(rows)} poses for {images} images; one for each is needed")
    poses = []
    for number, row in enumerate(rows, 1):
        pose = np.vstack([row.reshape(3, 4), [0, 0, 0, 1]])
        rotation = pose[:3, :3]
        if np.abs(rotation @ rotation.T - np.eye(3)).max() > 1e-2 or np.linalg.det(rotation) < 0:
            raise MotionError(f"{path}, pose {number}: its 3×3 part is no rotation")
        pose[:3, :3] = _nearest_rotation(pose[:3, :3])
        poses.append(pose)
    return poses


def _from_tum(path: Path, rows: Matrix, images: list[Path]) -> list[Matrix]:
    lengths = np.linalg.norm(rows[:, 4:], axis=1)
    worst = int(np.abs(lengths - 1).argmax())
    if abs(lengths[worst] - 1) > UNIT_LENGTH:
        raise MotionError(
            f"{path}: the quaternion at {rows[worst, 0]:.6f} has length {lengths[worst]:.3g},"
            f" 1 ± {UNIT_LENGTH} is needed"
        )
    rows = rows[np.argsort(rows[:, 0])]
    poses = []
    for image in images:
        try:
            time = float(image.stem)
        except ValueError as error:
            raise MotionError(
                f"{image.name}: its name is no time, so no pose of {path} belongs to it"
            ) from error
        after = max(int(np.searchsorted(rows[:, 0], time)), 1)
        if not (rows[0, 0] <= time <= rows[-1, 0]) or len(rows) < 2:
            raise MotionError(
                f"{path}: no pose at the time of {image.name}; the poses span {rows[0, 0]:.3f} to {rows[-1, 0]:.3f} s"
            )
        before, following = rows[after - 1], rows[after]
        gap = following[0] - before[0]
        if gap > LONGEST_GAP_S:
            raise MotionError(
                f"{path}: {gap:.2f} s without a pose around {image.name}, at most {LONGEST_GAP_S} s"
            )
        # Two poses of one time can only be at the very beginning.
        share = (time - before[0]) / gap if gap > 0 else 0.0
        pose = np.eye(4)
        pose[:3, 3] = (1 - share) * before[1:4] + share * following[1:4]
        sign = 1.0 if before[4:] @ following[4:] >= 0 else -1.0
        pose[:3, :3] = _rotation((1 - share) * before[4:] + share * sign * following[4:])
        poses.append(pose)
    return poses


def _rotation(quaternion: Matrix) -> Matrix:
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _nearest_rotation(matrix: Matrix) -> Matrix:
    u, _, v = np.linalg.svd(matrix)
    return np.asarray(u @ v)
