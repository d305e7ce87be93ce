"""A world: surfaces, the light on them, and the grey behind everything."""

from collections.abc import Iterable
from dataclasses import dataclass, field

from sim_devices.worlds.placement import Signal, constant
from sim_devices.worlds.surface import Surface


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

    def elapsed(self, t: float) -> float:
        """Seconds since the paths began, never negative."""
        return max(0.0, t - self.epoch)

    def add(self, *surfaces: Surface) -> None:
        """Put more surfaces into the world."""
        self.surfaces.extend(surfaces)

    def extend(self, surfaces: Iterable[Surface]) -> None:
        """Put all of ``surfaces`` into the world."""
        self.surfaces.extend(surfaces)
