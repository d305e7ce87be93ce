"""Intrinsics from views of a ChArUco board: corners found by OpenCV, parameters with their uncertainty."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.errors import CameraCalibrationError
from perception.camera.frame import Image
from perception.camera.intrinsics import Intrinsics

Array = NDArray[np.float64]
LEAST_VIEWS = 6
LEAST_CORNERS = 8
WORST_RESIDUAL_PX = 1.0
WORST_FOCAL_DEVIATION = 0.01
LEAST_TURN_DEG = 15.0


@dataclass(frozen=True)
class CalibrationBoard:
    """A printed ChArUco board: columns x rows of squares, sides in metres, one of OpenCV's dictionaries.

    Raises:
        CameraCalibrationError: a size is not possible or OpenCV has no such dictionary.
    """

    columns: int = 8
    rows: int = 6
    square: float = 0.04
    marker: float = 0.03
    dictionary: str = "DICT_4X4_100"

    def __post_init__(self) -> None:
        if self.columns < 3 or self.rows < 3:
            raise CameraCalibrationError(f"a board of {self.columns} x {self.rows} squares is under 3 x 3")
        if not 0.0 < self.marker < self.square:
            raise CameraCalibrationError(
                f"markers of {self.marker} m do not fit into squares of {self.square} m (both above 0)"
            )
        if not (self.dictionary.startswith("DICT_") and hasattr(cv2.aruco, self.dictionary)):
            raise CameraCalibrationError(f"OpenCV has no marker dictionary {self.dictionary!r}")

    @cached_property
    def _charuco(self) -> "cv2.aruco.CharucoBoard":
        dictionary = cv2.aruco.getPredefinedDictionary(getattr(cv2.aruco, self.dictionary))
        return cv2.aruco.CharucoBoard((self.columns, self.rows), self.square, self.marker, dictionary)

    @cached_property
    def _detector(self) -> "cv2.aruco.CharucoDetector":
        return cv2.aruco.CharucoDetector(self._charuco)

    @property
    def size(self) -> tuple[float, float]:
        """Width and height in metres."""
        return self.columns * self.square, self.rows * self.square

    def draw(self, pixels_per_square: int = 64) -> Image:
        """The board as a picture to print, without a margin."""
        size = (self.columns * pixels_per_square, self.rows * pixels_per_square)
        return np.asarray(self._charuco.generateImage(size, marginSize=0, borderBits=1), np.uint8)

    def find(self, image: Image) -> "BoardView | None":
        """The board's corners in a grey image; None when fewer than eight are seen."""
        corners, ids, _, _ = self._detector.detectBoard(image)
        if ids is None or len(ids) < LEAST_CORNERS:
            return None
        points = np.asarray(self._charuco.getChessboardCorners(), float)[ids.ravel()]
        return BoardView(points, np.asarray(corners, float).reshape(-1, 2))


@dataclass(frozen=True, eq=False)
class BoardView:
    """Corners (n, 3) on the board in metres, z = 0, and where an image shows them (n, 2) in pixels."""

    points: Array
    pixels: Array


@dataclass(frozen=True, eq=False)
class IntrinsicsCalibration:
    """Intrinsics, the residual over all corners, each view's own, and the focal length's deviation, pixels."""

    intrinsics: Intrinsics
    residual_px: float
    view_residuals_px: tuple[float, ...]
    focal_deviation_px: float


def estimate_intrinsics(
    views: Sequence[BoardView], width: int, height: int, *, distortion: bool = True
) -> IntrinsicsCalibration:
    """Fit a pinhole with Brown distortion to views of the board, by OpenCV's calibration (Zhang).

    Args:
        views: at least six.
        width, height: of the images, pixels.
        distortion: False fits a lens without any.

    Raises:
        CameraCalibrationError: there are too few views, they do not determine the focal length within 1 %, the board
            was always seen from the same side, or the residual is above one pixel.
    """
    if len(views) < LEAST_VIEWS:
        raise CameraCalibrationError(
            f"{len(views)} views of the board are not enough, {LEAST_VIEWS} are needed"
        )
    flags = 0 if distortion else cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2 | cv2.CALIB_ZERO_TANGENT_DIST
    flags |= cv2.CALIB_FIX_K3
    guess = np.array([[width, 0.0, (width - 1) / 2], [0.0, width, (height - 1) / 2], [0.0, 0.0, 1.0]])
    try:
        residual, matrix, lens, turns, _, deviations, _, per_view = cv2.calibrateCameraExtended(
            [view.points.astype(np.float32) for view in views],
            [view.pixels.astype(np.float32) for view in views],
            (width, height),
            guess,
            np.zeros(5),
            flags=flags | cv2.CALIB_USE_INTRINSIC_GUESS,
        )
    except cv2.error as error:
        raise CameraCalibrationError(f"the views do not determine the camera: {error.err}") from error
    turned = _largest_turn_deg([np.ravel(turn) for turn in turns])
    if turned < LEAST_TURN_DEG:
        raise CameraCalibrationError(
            f"the board was turned by {turned:.1f}° between the views, at least {LEAST_TURN_DEG:g}° are needed "
            "to separate focal length from distance: turn the board against the camera"
        )
    k1, k2, p1, p2, k3 = (float(v) for v in np.ravel(lens)[:5])
    deviation = float(np.max(np.ravel(deviations)[:2]))
    focal = float(matrix[0, 0])
    if not deviation < WORST_FOCAL_DEVIATION * focal:
        raise CameraCalibrationError(
            f"the views leave the focal length uncertain by {deviation:.1f} px of {focal:.0f} px (allowed: "
            f"{100 * WORST_FOCAL_DEVIATION:g} %): turn the board against the camera by 20° and more"
        )
    if residual > WORST_RESIDUAL_PX:
        raise CameraCalibrationError(
            f"corners miss the fitted camera by {residual:.2f} px, more than {WORST_RESIDUAL_PX:g} px: "
            "is the board flat and its size right?"
        )
    intrinsics = Intrinsics(
        width,
        height,
        focal,
        float(matrix[1, 1]),
        float(matrix[0, 2]),
        float(matrix[1, 2]),
        (k1, k2, p1, p2, k3),
    )
    return IntrinsicsCalibration(
        intrinsics, float(residual), tuple(float(v) for v in np.ravel(per_view)), deviation
    )


def _largest_turn_deg(turns: Sequence[Array]) -> float:
    """The largest angle between the board's normals in any two views."""
    normals = np.stack([cv2.Rodrigues(turn)[0][:, 2] for turn in turns])
    return float(np.degrees(np.arccos(np.clip((normals @ normals.T).min(), -1.0, 1.0))))
