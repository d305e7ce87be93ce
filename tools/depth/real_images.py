"""The real images of ../shared/data with their truth; None where the folder is absent."""

from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth import Pinhole
from tools.depth.scenes import Sequence

Image = NDArray[np.uint8]
Field = NDArray[np.float32]
DATA = Path(__file__).resolve().parents[3] / "shared" / "data"

FOCAL_PX = 100.0
STEP_M = 0.01
"""Focal length and step given to lateral views: their product is 1, so that inverse depth in 1/m is disparity in px."""


@dataclass(frozen=True)
class Views:
    """Images of one row of cameras, each one's place (in steps to the right), and the true disparity of one."""

    name: str
    images: list[Image]
    places: list[float]
    truth: Field
    reference: int
    most: int
    """Disparities searched, a multiple of 16."""

    @property
    def camera(self) -> Pinhole:
        """Any focal length does: with lateral motion only its product with the step counts."""
        height, width = self.truth.shape
        return Pinhole(FOCAL_PX, FOCAL_PX, (width - 1) / 2, (height - 1) / 2)

    def motion(self, first: int, second: int) -> Motion:
        """From one view to another."""
        step = STEP_M * (self.places[second] - self.places[first])
        return Motion(np.eye(3), np.array([-step, 0.0, 0.0]))


def _read(path: Path, flags: int = cv2.IMREAD_COLOR) -> Image:
    image = cv2.imread(str(path), flags)
    if image is None:
        raise FileNotFoundError(path)
    return np.asarray(image)


def _read_truth(path: Path, scale: float) -> Field:
    truth = _read(path, cv2.IMREAD_UNCHANGED).astype(np.float32) / np.float32(scale)
    return np.where(truth > 0, truth, np.float32(np.nan))


def read_tsukuba() -> Views | None:
    """Five views with equal steps to the right; the truth is that of the third, in px a step."""
    folder = DATA / "stereo_tsukuba"
    if not folder.is_dir():
        return None
    return Views(
        "Tsukuba",
        [_read(folder / f"scene1.row3.col{k}.ppm") for k in range(1, 6)],
        [0.0, 1.0, 2.0, 3.0, 4.0],
        _read_truth(folder / "truedisp.row3.col3.pgm", 16),
        2,
        16,
    )


def read_cones() -> Views | None:
    """One pair; the truth is that of the left view."""
    folder = DATA / "stereo_cones"
    if not folder.is_dir():
        return None
    return Views(
        "Cones",
        [_read(folder / "im2.png"), _read(folder / "im6.png")],
        [0.0, 1.0],
        _read_truth(folder / "disp2.pgm", 4),
        0,
        64,
    )


def _rotation(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    x, y, z, w = quaternion / np.linalg.norm(quaternion)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def read_tum() -> Sequence | None:
    """Nine frames of fr1/desk with their poses; the truth is the depth camera's, NaN where it saw nothing."""
    folder = DATA / "tum_fr1desk9"
    if not folder.is_dir():
        return None
    track = np.loadtxt(folder / "groundtruth.txt")
    depths = sorted((folder / "depth").glob("*.png"))
    depth_times = np.array([float(path.stem) for path in depths])
    images, truth, poses = [], [], []
    for path in sorted((folder / "rgb").glob("*.png")):
        t = float(path.stem)
        after = int(np.searchsorted(track[:, 0], t))
        first, second = track[after - 1], track[after]
        part = (t - first[0]) / (second[0] - first[0])
        near = np.sign(first[4:] @ second[4:])
        pose = np.eye(4)
        pose[:3, 3] = (1 - part) * first[1:4] + part * second[1:4]
        pose[:3, :3] = _rotation((1 - part) * first[4:] + part * near * second[4:])
        metres = _read(depths[int(np.abs(depth_times - t).argmin())], cv2.IMREAD_UNCHANGED) / 5000.0
        images.append(_read(path))
        truth.append(1 / np.where(metres > 0, metres, np.nan))
        poses.append(pose)
    return Sequence("TUM fr1/desk", Pinhole(517.3, 516.5, 318.6, 255.3), images, truth, poses)
