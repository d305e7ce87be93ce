"""A world: surfaces, the light on them, and the grey behind everything."""

from collections.abc import Iterable
from dataclasses import dataclass, field
from math import hypot, inf

import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.placement import Placement, Signal, Still, constant
from sim_devices.worlds.surface import Rectangle, Surface

Array = NDArray[np.float64]


@dataclass(eq=False)
class World:
    """Surfaces in metres, x forward, y left, z up; the head's axes meet at the origin.

    ``light`` scales everything that does not glow, the sky too: 1 is day, 0 is lights out; ``flicker`` scales
    it in time, and ``gradient`` is its relative change per metre along x, y, z from the origin. All paths
    begin at ``epoch``; before it every surface stands where its path starts.
    """

    surfaces: list[Surface] = field(default_factory=list)
    sky: float = 40.0
    light: float = 1.0
    epoch: float = 0.0
    flicker: Signal = field(default_factory=lambda: constant(1.0))
    gradient: tuple[float, float, float] = (0.0, 0.0, 0.0)
    _bounded: list[Surface] = field(default_factory=list, init=False, repr=False)
    _bounds: tuple[Array, Array] = field(
        default_factory=lambda: (np.zeros((0, 3)), np.zeros(0)), init=False, repr=False
    )

    def elapsed(self, t: float) -> float:
        """Seconds since the paths began, never negative."""
        return max(0.0, t - self.epoch)

    def add(self, *surfaces: Surface) -> None:
        """Put more surfaces into the world."""
        self.surfaces.extend(surfaces)

    def extend(self, surfaces: Iterable[Surface]) -> None:
        """Put all of ``surfaces`` into the world."""
        self.surfaces.extend(surfaces)

    def within(self, camera: Placement, pyramid: Array) -> list[Surface]:
        """The surfaces of which something may lie inside a pyramid of rays; moving ones are all kept.

        ``pyramid`` (n, 3): inward unit normals of its sides, in the camera's axes.
        """
        if self._bounded != self.surfaces:
            self._bounded = list(self.surfaces)
            self._bounds = _bounds(self._bounded)
        centres, radii = self._bounds
        reach = (centres - camera.position) @ (camera.rotation @ pyramid.T)
        kept = np.all(reach > -radii[:, None], axis=1)
        return [self._bounded[i] for i in np.flatnonzero(kept).tolist()]


def _bounds(surfaces: list[Surface]) -> tuple[Array, Array]:
    """Centres (n, 3) and radii (n,) of balls about the surfaces; infinite about what moves."""
    centres, radii = np.zeros((len(surfaces), 3)), np.full(len(surfaces), inf)
    for i, surface in enumerate(surfaces):
        if isinstance(surface.motion, Still):
            centres[i] = surface.motion.placement.position
            if isinstance(surface, Rectangle):
                radii[i] = hypot(surface.width, surface.height) / 2.0
            else:
                radii[i] = surface.radius
            radii[i] += 1e-6
    return centres, radii
