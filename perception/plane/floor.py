"""The floor ahead of a moving camera, watched for what stands on it: key frames, its homography, heights over it."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.plane.direct import estimate_plane_motion
from perception.plane.heights import HeightMap, measure_heights
from perception.plane.metric_plane import MetricPlane
from perception.plane.obstacles import Obstacle, find_obstacles
from perception.plane.parallax import Parallax
from perception.plane.plane_motion import PlaneMotion
from perception.plane.template import Template
from perception.plane.window import Window

Image = NDArray[np.uint8]
Vector = NDArray[np.float64]
ENOUGH_PX = 10.0
"""Motion of the floor after which the newest image becomes the key frame: it shows low things well enough."""
BORDER_PX = 8


@dataclass(frozen=True, eq=False)
class FloorSight:
    """What one image says of the floor, compared with the key frame."""

    seen: PlaneMotion | None
    """The floor's motion since the key frame; None when it was not seen."""
    motion: Motion
    """The camera's, since the key frame."""
    floor: MetricPlane
    """In the key frame."""
    flow_px: float
    """By how much the floor in the middle of the key frame has moved."""
    heights: HeightMap | None
    obstacles: list[Obstacle]

    @property
    def believed(self) -> bool:
        """Whether the motion of most of the floor was seen, so that no obstacle means none."""
        return self.seen is not None and self.seen.believed

    def place_of(self, obstacle: Obstacle, camera: Intrinsics) -> Vector:
        """The middle of an obstacle's surest cells in the newest view, m (x right, y down, z forward)."""
        x, y = obstacle.place_px
        ray = np.array([(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1.0])
        point = ray / (ray @ self.floor.q) * (1 - obstacle.height)
        return self.motion.rotation @ point + self.motion.translation


class FloorWatch:
    """Looks at one image after another. The key frame stays until the floor has moved enough since."""

    def __init__(self, camera: Intrinsics, floor: MetricPlane) -> None:
        """floor: in the frame of the camera, which keeps its height and pitch while it moves."""
        self.camera, self.floor = camera, floor
        self._key: Template | None = None
        self._motion = Motion.identity()

    def step(self, image: Image, motion: Motion) -> FloorSight | None:
        """The next image and the camera's motion since the one before; None for the first, which only is the key."""
        if self._key is None:
            self._begin(image)
            return None
        key, camera, floor = self._key, self.camera, self.floor
        self._motion = self._motion.then(motion)
        since = self._motion
        prior = floor.homography(camera, since)
        seen = estimate_plane_motion(key, image, prior)
        flow_px = _flow_px(key.window, prior, camera, since)
        heights, obstacles = None, []
        # Also what hides most of the floor has a height, though it may have been taken for the floor.
        if seen is not None and seen.known:
            parallax = Parallax.of(key.window, camera, since, floor.q)
            heights = measure_heights(key, image, seen, parallax)
            obstacles = find_obstacles(heights)
        if flow_px >= ENOUGH_PX or seen is None:
            self._begin(image)
        return FloorSight(seen, since, floor, flow_px, heights, obstacles)

    def _begin(self, image: Image) -> None:
        height, width = image.shape
        window = Window.central(image.shape, width - 2 * BORDER_PX, height - 2 * BORDER_PX)
        self._key, self._motion = Template(image, window), Motion.identity()


def _flow_px(window: Window, homography: Vector, camera: Intrinsics, motion: Motion) -> float:
    """By how much the middle of the window moves, less what rotation moves: only that shows heights."""
    middle = window.to_pixels[:, 2]
    turned = camera.matrix @ motion.rotation @ np.linalg.inv(camera.matrix)
    places = [(h @ middle)[:2] / (h @ middle)[2] for h in (homography, turned)]
    return float(np.linalg.norm(places[0] - places[1]))
