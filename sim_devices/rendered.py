"""A rendered world as a part of the bench: its light, the cameras in it, and their incidents."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from sim_devices.camera import SimulatedCamera
from sim_devices.link.line import Device
from sim_devices.worlds.world import World


class RenderedWorld:
    """A world and the cameras that look into it, whoever carries them; a part without a line.

    ``ports`` are the TCP ports on which cameras shall be served; 0 or none takes a free one.
    """

    def __init__(self, world: World, cameras: Iterable[SimulatedCamera] = ()) -> None:
        self.world = world
        self.cameras: dict[str, SimulatedCamera] = {}
        self.ports: dict[str, int] = {}
        for camera in cameras:
            self.mount(camera)
        self.verbs: Mapping[str, Callable[..., Any]] = {
            "lights": self.lights,
            "camera": self.camera,
            "dark": self.dark,
            "delay": self.delay,
        }
        self._now = 0.0

    def mount(self, camera: SimulatedCamera, port: int = 0) -> None:
        """Add a camera; raises ValueError when its name is taken or it looks into another world."""
        if camera.name in self.cameras:
            raise ValueError(f"there are two cameras {camera.name!r}")
        if camera.world is not self.world:
            raise ValueError(f"camera {camera.name!r} is in another world")
        self.cameras[camera.name] = camera
        self.ports[camera.name] = port

    def power_up(self, t: float) -> None:
        """The paths begin here."""
        self.world.epoch = self._now = t

    def lines(self) -> Mapping[str, Sequence[Device]]:
        """No device hangs on a line here."""
        return {}

    def advance_to(self, t: float) -> None:
        """The time at which ``state`` looks and verbs act."""
        self._now = max(self._now, t)

    def state(self) -> dict[str, Any]:
        """The light, and how the cameras do."""
        return {
            "light": self.world.light,
            "cameras": {
                name: {"dead": c.dead, "dark": c.dark, "delay": c.delay, "exposures": c.sequence}
                for name, c in self.cameras.items()
            },
        }

    def start(self) -> None:
        """All cameras begin to expose, together."""
        for camera in self.cameras.values():
            camera.start()

    def stop(self) -> None:
        """All cameras stop."""
        for camera in self.cameras.values():
            camera.stop()

    def lights(self, level: float) -> None:
        """Set the light on everything that does not glow; 0 is lights out."""
        if not level >= 0.0:
            raise ValueError(f"light is {level}, must be 0 or more")
        self.world.light = level

    def camera(self, side: str, dead: bool) -> None:
        """Kill or revive a camera by its name, or its side on the head."""
        self._camera(side).dead = dead

    def dark(self, side: str, dark: bool) -> None:
        """Cover a camera's lens, or uncover it."""
        self._camera(side).dark = dark

    def delay(self, side: str, seconds: float) -> None:
        """Deliver a camera's pictures so much later."""
        if not seconds >= 0.0:
            raise ValueError(f"delay is {seconds} s, must be 0 or more")
        self._camera(side).delay = seconds

    def _camera(self, name: str) -> SimulatedCamera:
        if name not in self.cameras:
            raise ValueError(f"there is no {name!r} camera; there is {', '.join(self.cameras)}")
        return self.cameras[name]
