"""The light of a world at one moment: one level, or falling along a direction."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.placement import Placement
from sim_devices.worlds.sight import Affine, over_rays
from sim_devices.worlds.world import World

Grey = NDArray[np.float32]


@dataclass(frozen=True)
class Light:
    """Light on a point at depth Z of a ray r: level (1 + here + Z (slope . r)), never below zero."""

    level: float
    here: float = 0.0
    slope: Affine = (0.0, 0.0, 0.0)

    @property
    def even(self) -> bool:
        """Whether everything is lit alike."""
        return self.slope == (0.0, 0.0, 0.0)

    def fall_on(self, shade: Grey, inverse_depth: Grey, columns: Grey, rows: Grey) -> None:
        """Multiply the grey levels of lit surfaces by the light on them."""
        if self.even:
            if self.level != 1.0:
                shade *= np.float32(self.level)
            return
        lit = over_rays(self.slope, columns, rows)
        lit /= np.maximum(inverse_depth, np.float32(1e-6))
        lit += np.float32(1.0 + self.here)
        shade *= np.maximum(lit, np.float32(0.0))
        shade *= np.float32(self.level)


def light_on(world: World, camera: Placement, t: float) -> Light:
    """The world's light ``t`` seconds after its start, as a camera sees its gradient."""
    level = world.light * world.flicker(t)
    if world.gradient == (0.0, 0.0, 0.0):
        return Light(level)
    gradient = np.array(world.gradient)
    across, down, ahead = (gradient @ camera.rotation).tolist()
    return Light(level, float(gradient @ camera.position), (across, down, ahead))
