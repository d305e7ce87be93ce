"""Rendered sequences with exact depth: planes, boxes and a relief under a solid texture of plane waves.

The texture is a function of the point in space, so nothing is interpolated: an image's grey levels are
right to the last bit of the arithmetic, and the inverse depth is that of the ray through the pixel.
"""

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth import Pinhole

Array = NDArray[np.float64]


def waves(seed: int, shortest: float, longest: float, count: int = 48) -> Callable[[Array], Array]:
    """A texture of plane waves, wave lengths spread evenly over the octaves; mean 0, standard deviation 1.

    Points are … × 3, metres.
    """
    rng = np.random.default_rng(seed)
    length = np.exp(rng.uniform(np.log(shortest), np.log(longest), count))
    direction = rng.normal(size=(count, 3))
    direction /= np.linalg.norm(direction, axis=1, keepdims=True)
    wave = (2 * np.pi / length[:, None] * direction).astype(np.float32)
    phase = rng.uniform(0, 2 * np.pi, count).astype(np.float32)

    def texture(points: Array) -> Array:
        flat = points.reshape(-1, 3).astype(np.float32)
        total = np.zeros(len(flat), np.float32)
        for k in range(count):
            total += np.cos(flat @ wave[k] + phase[k])
        return np.asarray((total * np.sqrt(2 / count)).reshape(points.shape[:-1]), np.float64)

    return texture


@dataclass(frozen=True)
class Plane:
    """A rectangle (or a whole plane) through `point`, spanned by unit vectors u and v; half sides in metres."""

    point: tuple[float, float, float]
    u: tuple[float, float, float]
    v: tuple[float, float, float]
    half: tuple[float, float] = (np.inf, np.inf)

    def meet(self, origin: Array, rays: Array) -> Array:
        """Ray parameter of the hit, ∞ where there is none."""
        u, v, point = np.array(self.u), np.array(self.v), np.array(self.point)
        normal = np.cross(u, v)
        with np.errstate(divide="ignore", invalid="ignore"):
            s = np.asarray(((point - origin) @ normal) / (rays @ normal))
            there = origin + s[..., None] * rays - point
            good = (s > 1e-6) & (np.abs(there @ u) <= self.half[0]) & (np.abs(there @ v) <= self.half[1])
        return np.where(good, s, np.inf)


@dataclass(frozen=True)
class Relief:
    """A plane with a height over it, toward u × v; gentle enough for each ray to meet it once."""

    plane: Plane
    height: Callable[[Array, Array], Array]

    def meet(self, origin: Array, rays: Array) -> Array:
        """Ray parameter of the hit, by Newton's step along the plane's normal until it converges."""
        u, v, point = np.array(self.plane.u), np.array(self.plane.v), np.array(self.plane.point)
        normal = np.cross(u, v)
        s = self.plane.meet(origin, rays)
        known = np.isfinite(s)
        s = np.where(known, s, 1.0)
        descent = rays @ normal
        for _ in range(40):
            there = origin + s[..., None] * rays - point
            s = s - (there @ normal - self.height(there @ u, there @ v)) / descent
        return np.where(known, s, np.inf)


@dataclass(frozen=True)
class Scene:
    """Surfaces, the texture they share, and how light it is."""

    surfaces: tuple[Plane | Relief, ...]
    texture: Callable[[Array], Array]
    mean: float = 120.0
    contrast: float = 35.0
    shade: Callable[[Array], Array] | None = None

    def render(
        self, camera: Pinhole, size: tuple[int, int], pose: Array, samples: int = 2
    ) -> tuple[Array, Array]:
        """Grey levels (not yet whole numbers) and inverse depth seen from a 4×4 camera-to-world pose.

        size is (width, height); each pixel is the mean of samples² rays.
        """
        offsets = (np.arange(samples) + 0.5) / samples - 0.5
        grey = np.zeros((size[1], size[0]))
        for dy in offsets:
            for dx in offsets:
                _, points = self._look(camera, size, pose, float(dx), float(dy))
                grey += self._paint(points)
        depth, _ = self._look(camera, size, pose, 0.0, 0.0)
        return grey / samples**2, 1 / depth

    def _paint(self, points: Array) -> Array:
        grey = self.mean + self.contrast * self.texture(points)
        return grey if self.shade is None else grey * self.shade(points)

    def _look(
        self, camera: Pinhole, size: tuple[int, int], pose: Array, dx: float, dy: float
    ) -> tuple[Array, Array]:
        x = (np.arange(size[0]) + dx - camera.cx) / camera.fx
        y = (np.arange(size[1]) + dy - camera.cy) / camera.fy
        rays = np.stack([*np.meshgrid(x, y), np.ones((size[1], size[0]))], axis=-1) @ pose[:3, :3].T
        depth = np.full((size[1], size[0]), 1e6)
        for surface in self.surfaces:
            depth = np.minimum(depth, surface.meet(pose[:3, 3], rays))
        return depth, pose[:3, 3] + depth[..., None] * rays


@dataclass(frozen=True)
class Sequence:
    """Images, the truth of each, and the motion from each to the next."""

    name: str
    camera: Pinhole
    images: list[NDArray[np.uint8]]
    truth: list[Array]
    poses: list[Array] = field(repr=False)

    @property
    def motions(self) -> list[Motion]:
        """From each view to the next."""
        return [Motion.between(a, b) for a, b in zip(self.poses, self.poses[1:], strict=False)]


def place(x: float, y: float, z: float, pitch: float = 0.0, yaw: float = 0.0) -> Array:
    """A camera-to-world pose: position in metres, pitch about x and yaw about y in radians."""
    cp, sp, cy, sy = np.cos(pitch), np.sin(pitch), np.cos(yaw), np.sin(yaw)
    pose = np.eye(4)
    pose[:3, :3] = np.array([[cy, 0, sy], [0, 1, 0], [-sy, 0, cy]]) @ np.array(
        [[1, 0, 0], [0, cp, -sp], [0, sp, cp]]
    )
    pose[:3, 3] = x, y, z
    return pose


def expose(grey: Array, noise: float, rng: np.random.Generator) -> NDArray[np.uint8]:
    """Whole grey levels of 8 bits, with Gaussian noise."""
    noisy = grey + (rng.normal(0, noise, grey.shape) if noise > 0 else 0)
    return np.clip(np.rint(noisy), 0, 255).astype(np.uint8)


def render_sequence(
    name: str,
    scene: Scene,
    camera: Pinhole,
    size: tuple[int, int],
    poses: list[Array],
    noise: float = 0.0,
    light: Callable[[int], float] | None = None,
    seed: int = 0,
    samples: int = 2,
) -> Sequence:
    """Render a scene along the poses; light(i) is the gain of image i."""
    rng = np.random.default_rng(seed)
    images, truth = [], []
    for i, pose in enumerate(poses):
        grey, inverse_depth = scene.render(camera, size, pose, samples)
        images.append(expose(grey * (1.0 if light is None else light(i)), noise, rng))
        truth.append(inverse_depth)
    return Sequence(name, camera, images, truth, poses)


def slanted_plane(
    frames: int = 6,
    noise: float = 0.0,
    size: tuple[int, int] = (192, 144),
    seed: int = 1,
    slant: float = 0.5,
    step: tuple[float, float] | None = None,
    yaw: float = 0.0,
) -> Sequence:
    """A plane 2 m away, slanted about the vertical, seen by a camera that moves.

    Args:
        step: by how much an image, right and forward, m; 8 px to the right by default.
        yaw: by how much it turns an image, rad.
    """
    focal = size[0] * 1.0
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
    turned = (float(np.cos(slant)), 0.0, float(np.sin(slant)))
    scene = Scene((Plane((0, 0, 2), turned, (0, 1, 0)),), waves(seed, 8.0 / focal, 0.5))
    right, forward = (8 * 2 / focal, 0.0) if step is None else step
    poses = [place(right * i, 0, forward * i, yaw=yaw * i) for i in range(frames)]
    return render_sequence("plane", scene, camera, size, poses, noise, seed=seed)


def table_top(
    frames: int = 12, noise: float = 1.0, size: tuple[int, int] = (256, 192), seed: int = 2
) -> Sequence:
    """Boxes on a table before a wall; the camera moves right for half of the images, then up (figure 2.12)."""
    focal = size[0] * 1.1
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
    right, down, away = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    surfaces: list[Plane | Relief] = [
        Plane((0, 0, 2.4), right, down),
        Plane((0, 0.42, 1.6), right, away),
    ]
    for x, z, width, height, depth in (
        (-0.35, 1.25, 0.28, 0.34, 0.2),
        (0.2, 1.5, 0.3, 0.5, 0.2),
        (0.42, 1.1, 0.2, 0.2, 0.2),
    ):
        top = 0.42 - height
        surfaces += [
            Plane((x, top + height / 2, z), right, down, (width / 2, height / 2)),
            Plane((x, top, z + depth / 2), right, away, (width / 2, depth / 2)),
            Plane((x - width / 2, top + height / 2, z + depth / 2), away, down, (depth / 2, height / 2)),
            Plane((x + width / 2, top + height / 2, z + depth / 2), away, down, (depth / 2, height / 2)),
        ]
    scene = Scene(tuple(surfaces), waves(seed, 7.0 / focal, 0.4))
    step, half = 0.03, (frames + 1) // 2
    poses = [place(step * min(i, half - 1), -step * max(0, i - half + 1), 0) for i in range(frames)]
    return render_sequence("table-top", scene, camera, size, poses, noise, seed=seed)


def sea_bed(
    frames: int = 8,
    noise: float = 2.0,
    size: tuple[int, int] = (256, 192),
    seed: int = 3,
    contrast: float = 9.0,
) -> Sequence:
    """A rolling sea bed before a camera that sinks at 1 m/s, an image every 0.4 s, in poor and changing light."""
    focal = size[0] * 1.0
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)

    def height(u: Array, v: Array) -> Array:
        return np.asarray(
            0.5 * np.sin(0.8 * u + 0.3) * np.cos(0.7 * v)
            + 1.1 * np.exp(-((u - 1.5) ** 2 + (v + 1) ** 2) / 0.9)
            + 0.9 * np.exp(-((u + 2.0) ** 2 + (v - 1.2) ** 2) / 0.7)
        )

    tilt = np.radians(55)
    plane = Plane((0, 1.5, 11.0), (1, 0, 0), (0, float(np.sin(tilt)), float(-np.cos(tilt))))
    # u × v points away from the camera; the relief rises toward it.
    relief = Relief(plane, lambda u, v: -height(u, v))
    scene = Scene((relief,), waves(seed, 9.0 * 11 / focal / 2, 4.0), mean=70.0, contrast=contrast)
    poses = [place(0, -1.4 + 0.4 * i, 0) for i in range(frames)]
    return render_sequence(
        "sea bed", scene, camera, size, poses, noise, lambda i: 1 + 0.2 * np.sin(1.7 * i), seed=seed
    )


def stripes(
    frames: int = 8, turn: int = 4, noise: float = 1.0, size: tuple[int, int] = (160, 120)
) -> Sequence:
    """A wall of upright stripes with a board of level ones before it; the camera moves right, from `turn` on up."""
    focal = size[0] * 1.0
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
    rng = np.random.default_rng(5)
    length = np.exp(rng.uniform(np.log(7.0 / focal * 1.5), np.log(0.3), 12))
    phase = rng.uniform(0, 2 * np.pi, 12)

    def texture(points: Array) -> Array:
        board = points[..., 2] < 1.75
        # Not quite level and upright: a stripe exactly along the motion determines nothing at all.
        along = np.where(
            board, points[..., 1] + 0.03 * points[..., 0], points[..., 0] + 0.03 * points[..., 1]
        )
        return np.asarray(np.cos(2 * np.pi * along[..., None] / length + phase).sum(axis=-1) / np.sqrt(6))

    right, down = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)
    scene = Scene((Plane((0, 0, 2), right, down), Plane((0.05, 0, 1.5), right, down, (0.32, 0.25))), texture)
    step = 0.05
    poses = [place(step * min(i, turn), -step * max(0, i - turn), 0) for i in range(frames)]
    return render_sequence("stripes", scene, camera, size, poses, noise, samples=1)


def approach(frames: int = 5, noise: float = 1.0, size: tuple[int, int] = (160, 120)) -> Sequence:
    """A slanted floor and a wall before a camera that moves forward and turns a little."""
    focal = size[0] * 0.9
    camera = Pinhole(focal, focal, (size[0] - 1) / 2, (size[1] - 1) / 2)
    right, down, away = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
    scene = Scene(
        (Plane((0, 0.8, 0), right, away), Plane((0, 0, 5.0), right, down)), waves(7, 10.0 * 3 / focal, 1.0)
    )
    poses = [place(0.02 * i, 0, 0.3 * i, yaw=0.01 * i) for i in range(frames)]
    return render_sequence("approach", scene, camera, size, poses, noise)
