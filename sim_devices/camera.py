"""A camera in a rendered world: it exposes on a clock, with a sensor's faults, and delivers late."""

import asyncio
from collections.abc import Callable
from dataclasses import dataclass
from zlib import crc32

import numpy as np
from numpy.typing import NDArray

from sim_devices.worlds.config import SensorConfig
from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement
from sim_devices.worlds.render import render
from sim_devices.worlds.world import World

Pose = Callable[[float], Placement]


@dataclass(frozen=True)
class Sensor:
    """What the electronics do to the light.

    ``rate`` exposures a second; ``exposure`` seconds over which motion blurs, as the mean of
    ``blur_samples`` instants; ``gain``, and ``gain_drift``, its relative change per second of the world;
    ``vignette``, the part of the light lost in the corners; ``noise``, standard deviation in grey levels;
    ``latency`` from the middle of the exposure to delivery; ``drop``, the probability of no delivery.
    """

    rate: float = 6.0
    exposure: float = 0.0
    blur_samples: int = 1
    gain: float = 1.0
    vignette: float = 0.0
    noise: float = 0.0
    latency: float = 0.0
    drop: float = 0.0
    gain_drift: float = 0.0

    @classmethod
    def configured(cls, config: SensorConfig) -> "Sensor":
        """From a table of the configuration."""
        return cls(
            rate=config.rate_hz,
            exposure=config.exposure_ms * 1e-3,
            blur_samples=config.blur_samples,
            gain=config.gain,
            vignette=config.vignette,
            noise=config.noise,
            latency=config.latency_ms * 1e-3,
            drop=config.drop,
            gain_drift=config.gain_drift,
        )

    def __post_init__(self) -> None:
        if not self.rate > 0.0:
            raise ValueError(f"a camera needs a positive rate, not {self.rate} Hz")
        if self.blur_samples < 1 or not 0.0 <= self.exposure <= 1.0 / self.rate:
            raise ValueError(f"exposure {self.exposure} s must fit into a period of {1.0 / self.rate:.4g} s")
        if not (0.0 <= self.vignette < 1.0 and 0.0 <= self.drop <= 1.0):
            raise ValueError("vignette must lie in [0, 1) and drop in [0, 1]")
        if self.noise < 0.0 or self.latency < 0.0 or self.gain < 0.0:
            raise ValueError(
                f"noise {self.noise}, latency {self.latency} s and gain {self.gain} cannot be negative"
            )


@dataclass(frozen=True, eq=False)
class Picture:
    """A grey image (height, width), the middle of its exposure on the loop's clock, and its number."""

    image: NDArray[np.uint8]
    stamp: float
    sequence: int


class SimulatedCamera:
    """A camera whose optical frame stands at ``pose(t)`` in a world.

    ``pose`` is asked in the order of time, at the exposures themselves. Only ``window`` of the image is read
    out, when it is given. ``dead`` stops the pictures, ``dark`` lets no light in, ``delay`` adds to the
    latency; all may be changed while it runs. The same seed gives the same pictures.
    """

    def __init__(
        self,
        name: str,
        world: World,
        optics: Optics,
        sensor: Sensor,
        pose: Pose,
        *,
        seed: int = 0,
        window: Window | None = None,
    ) -> None:
        if window is not None:
            optics.check(window)
        self.name = name
        self.world = world
        self.optics = optics
        self.sensor = sensor
        self.pose = pose
        self.window = window
        self.dead = False
        self.dark = False
        self.delay = 0.0
        self.sequence = 0
        self._seed = (seed, crc32(name.encode()))
        self._vignette = _vignette(optics, sensor)
        self._sinks: list[Callable[[Picture], None]] = []
        self._timer: asyncio.TimerHandle | None = None

    def expose(self, times: list[float], sequence: int, window: Window | None = None) -> Picture:
        """The picture of an exposure over ``times`` (seconds, ascending), its stamp their mean."""
        return self.develop([(t, self.pose(t)) for t in times], sequence, window)

    def develop(
        self, instants: list[tuple[float, Placement]], sequence: int, window: Window | None = None
    ) -> Picture:
        """The picture of an exposure during which the camera stood so at those times."""
        part = window or self.window or self.optics.whole
        stamp = float(np.mean([t for t, _ in instants]))
        light = self._light(instants, part)
        if self.sensor.gain != 1.0 or self.sensor.vignette:
            rows, columns = (
                slice(part.top, part.top + part.height),
                slice(part.left, part.left + part.width),
            )
            light = light * self._vignette[rows, columns]
        if self.sensor.gain_drift:
            drift = 1.0 + self.sensor.gain_drift * self.world.elapsed(stamp)
            light = light * np.float32(max(0.0, drift))
        if self.sensor.noise:
            rng = np.random.default_rng((*self._seed, sequence))
            light = light + np.float32(self.sensor.noise) * rng.standard_normal(light.shape, np.float32)
        image = np.clip(light + np.float32(0.5), 0.0, 255.0).astype(np.uint8)
        return Picture(image, stamp, sequence)

    def _light(self, instants: list[tuple[float, Placement]], part: Window) -> NDArray[np.float32]:
        if self.dark:
            return np.zeros((part.height, part.width), np.float32)
        light: NDArray[np.float32] = np.mean(
            [render(self.world, self.optics, p, t, part) for t, p in instants], axis=0
        )
        return light

    def instants(self, middle: float) -> list[float]:
        """The times at which an exposure around ``middle`` samples the world."""
        n = self.sensor.blur_samples
        return [middle + self.sensor.exposure * ((i + 0.5) / n - 0.5) for i in range(n)]

    def deliver_to(self, sink: Callable[[Picture], None]) -> Callable[[], None]:
        """Call ``sink`` with every picture when it arrives; returns what takes it off again."""
        self._sinks.append(sink)
        return lambda: self._sinks.remove(sink)

    def start(self) -> None:
        """Begin to expose, on the running loop's clock: the first time one period from now."""
        if self._timer is None:
            loop = asyncio.get_running_loop()
            self._expose_at(loop, loop.time() + 1.0 / self.sensor.rate)

    def stop(self) -> None:
        """No more exposures; what has been exposed is still delivered."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _expose_at(self, loop: asyncio.AbstractEventLoop, middle: float) -> None:
        pending = self.instants(middle)
        seen: list[tuple[float, Placement]] = []

        def instant() -> None:
            # On the wall clock a timer fires late; the world and the head can only be asked about the
            # present.
            now = max(loop.time(), pending.pop(0))
            if self._sinks and not self.dead:
                seen.append((now, self.pose(now)))
            if pending:
                self._timer = loop.call_at(pending[0], instant)
                return
            self._finish(loop, seen)
            following = middle + 1.0 / self.sensor.rate
            while following <= loop.time() - 0.5 / self.sensor.rate:
                following += 1.0 / self.sensor.rate
                self.sequence += 1
            self._expose_at(loop, following)

        self._timer = loop.call_at(pending[0], instant)

    def _finish(self, loop: asyncio.AbstractEventLoop, seen: list[tuple[float, Placement]]) -> None:
        sequence = self.sequence
        self.sequence += 1
        if not seen:
            return
        if self.sensor.drop:
            lottery = np.random.default_rng((*self._seed, sequence, 1))
            if lottery.random() < self.sensor.drop:
                return
        picture = self.develop(seen, sequence)
        due = picture.stamp + self.sensor.latency + self.delay
        for sink in list(self._sinks):
            if due <= loop.time():
                sink(picture)
            else:
                loop.call_at(due, sink, picture)


def _vignette(optics: Optics, sensor: Sensor) -> NDArray[np.float32]:
    """Gain of every pixel: ``gain`` on the axis, falling with the square of the distance from it."""
    x = (np.arange(optics.width) - optics.cx) / max(optics.width / 2.0, 1.0)
    y = (np.arange(optics.height) - optics.cy) / max(optics.height / 2.0, 1.0)
    square = np.add.outer(y * y, x * x) / 2.0
    return (sensor.gain * (1.0 - sensor.vignette * np.minimum(square, 1.0))).astype(np.float32)
