"""How points over a plane move against it, and by what the second image shows that they do."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.plane.metric_plane import plane_homography
from perception.plane.window import Window

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
Vector = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class Parallax:
    """What a point at height h over the plane, which is H below the camera, does in the pixels of the first image.

    Its inverse depth is (1 + k) times that of the plane behind it, h/H = k/(1 + k), and it is displaced by k v to
    first order against the plane, v = ∂x₁/∂x₂ · (qᵀp) ∂x₂/∂ρ.
    """

    across: Field
    """v, to the right, pixels of the first image; NaN beyond the horizon of the plane."""
    down: Field
    camera: Intrinsics
    motion: Motion
    plane: Vector

    @classmethod
    def of(cls, window: Window, camera: Intrinsics, motion: Motion, plane: Vector) -> "Parallax":
        """For a camera that moves over the plane qᵀP = 1. Of t and q only t qᵀ counts: neither need be metric."""
        x, y = window.pixels()
        ray = np.stack(((x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, np.ones_like(x)), axis=-1)
        inverse_depth = ray @ plane
        moved = ray @ motion.rotation.T + inverse_depth[..., None] * motion.translation
        inverse_depth[(inverse_depth <= 0) | (moved[..., 2] <= 0)] = np.nan
        t, depth = motion.translation, moved[..., 2]
        place_x, place_y = moved[..., 0] / depth, moved[..., 1] / depth
        move_x = camera.fx * inverse_depth * (t[0] - place_x * t[2]) / depth
        move_y = camera.fy * inverse_depth * (t[1] - place_y * t[2]) / depth
        h = plane_homography(camera, motion, plane)
        pixel_x, pixel_y = camera.fx * place_x + camera.cx, camera.fy * place_y + camera.cy
        scale = h[2, 0] * x + h[2, 1] * y + h[2, 2]
        a, b = (h[0, 0] - pixel_x * h[2, 0]) / scale, (h[0, 1] - pixel_x * h[2, 1]) / scale
        c, d = (h[1, 0] - pixel_y * h[2, 0]) / scale, (h[1, 1] - pixel_y * h[2, 1]) / scale
        area = a * d - b * c
        across, down = (d * move_x - b * move_y) / area, (a * move_y - c * move_x) / area
        return cls(across.astype(np.float32), down.astype(np.float32), camera, motion, plane)

    def at(self, k: float, homography: Matrix) -> Matrix:
        """The homography of the plane's parallel at (1 + k) times its inverse depth, given that of the plane itself."""
        plane = plane_homography(self.camera, self.motion, self.plane)
        parallel = plane_homography(self.camera, self.motion, (1 + k) * self.plane)
        return np.asarray(homography @ np.linalg.solve(plane, parallel))
