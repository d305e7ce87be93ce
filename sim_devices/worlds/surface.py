"""What a world is made of: flat pictures, boxes of them, balls, and a screen that plays."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import floor

import numpy as np

from sim_devices.worlds.placement import Motion, Placement, mounted, still
from sim_devices.worlds.texture import Texture

Painting = Callable[[float], Texture | None]


@dataclass(frozen=True, eq=False)
class Rectangle:
    """A flat picture, metres; x right and y down from its centre, z away from the viewer.

    ``elliptic`` cuts the inscribed ellipse out of it; ``one_sided`` hides the back; what ``glows`` is seen
    without light. ``painting`` may change with time; None makes the surface vanish.
    """

    width: float
    height: float
    painting: Texture | Painting
    motion: Motion = field(default_factory=lambda: still(Placement()))
    elliptic: bool = False
    one_sided: bool = False
    glows: bool = False


@dataclass(frozen=True, eq=False)
class Sphere:
    """A ball with its texture wrapped round its own z, longitude 0 (own x) in the middle of the picture."""

    radius: float
    painting: Texture | Painting
    motion: Motion = field(default_factory=lambda: still(Placement()))
    glows: bool = False


Surface = Rectangle | Sphere


def texture_at(surface: Surface, t: float) -> Texture | None:
    """What the surface shows at ``t``; None when it is not there."""
    return _shown(surface.painting, t)


def _shown(painting: Texture | Painting, t: float) -> Texture | None:
    if isinstance(painting, Texture):
        return painting
    texture: Texture | None = painting(t)
    return texture


def box(size: tuple[float, float, float], painting: Texture, motion: Motion) -> list[Rectangle]:
    """The six outer faces of a box of ``size`` x, y, z metres about its own centre."""
    faces = []
    for axis in range(3):
        for sign in (1.0, -1.0):
            away = np.zeros(3)
            away[axis] = -sign
            down = np.array([1.0, 0.0, 0.0]) if axis == 2 else np.array([0.0, 0.0, -1.0])
            right = np.cross(down, away)
            offset = Placement(np.column_stack([right, down, away]), -away * size[axis] / 2.0)
            width, height = float(np.abs(right) @ size), float(np.abs(down) @ size)
            faces.append(Rectangle(width, height, painting, mounted(motion, offset), one_sided=True))
    return faces


def play(pictures: Sequence[Texture], rate: float, *, forth_and_back: bool = True) -> Painting:
    """A painting that shows ``pictures`` one after the other, ``rate`` a second, from t = 0 on."""
    if not pictures:
        raise ValueError("a screen needs at least one picture")
    order: list[int] = [*range(len(pictures)), *(range(len(pictures) - 2, 0, -1) if forth_and_back else ())]

    def at(t: float) -> Texture | None:
        # A frame exposed exactly on the change must not depend on rounding of k / rate.
        return pictures[order[floor(t * rate + 1e-6) % len(order)]]

    return at


def hidden_between(painting: Texture | Painting, start: float, stop: float) -> Painting:
    """The same painting, absent from ``start`` to ``stop`` seconds."""

    def at(t: float) -> Texture | None:
        return None if start <= t < stop else _shown(painting, t)

    return at
