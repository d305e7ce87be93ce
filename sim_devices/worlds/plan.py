"""A plan: walls, boxes, people, panels, floor and light of a world as data, which a TOML file spells out.

Metres, seconds and grey levels; x forward, y left, z up, the floor at z = 0. A base starts at the origin and
looks along x.
"""

from itertools import pairwise
from math import radians
from typing import Annotated, Literal

import msgspec
import numpy as np
from msgspec import Meta

from sim_devices.worlds.placement import Placement, rotation_about

Place = Annotated[float, Meta(ge=-1000.0, le=1000.0)]
Length = Annotated[float, Meta(gt=0.0, le=1000.0)]
Height = Annotated[float, Meta(ge=0.0, le=100.0)]
Grey = Annotated[float, Meta(ge=0.0, le=255.0)]
Angle = Annotated[float, Meta(ge=-360.0, le=360.0)]
Point = tuple[Place, Place]
Points = Annotated[list[Point], Meta(min_length=2)]


def _check_apart(name: str, points: list[Point]) -> None:
    for i, (here, there) in enumerate(pairwise(points)):
        if here == there:
            raise ValueError(f"{name}[{i}] and [{i + 1}] are both {list(here)}, must be apart")


class TextureConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What a surface is painted with.

    ``contrast`` c is a standard deviation of 40 c grey levels over one ``period``, after which the pattern
    repeats. ``noise``: equal energy in every octave (1/f) down to period/256. ``stripes``: upright bars of
    half a period. ``posters``: pictures of noise on a bare wall. ``bare``: the mean. ``image``: a file as
    it is, one period wide.
    """

    kind: Literal["noise", "stripes", "posters", "image", "bare"] = "noise"
    contrast: Annotated[float, Meta(ge=0.0, le=3.0)] = 0.5
    mean: Grey = 128.0
    period: Annotated[float, Meta(ge=0.002, le=100.0)] = 0.64
    seed: Annotated[int, Meta(ge=0)] = 0
    file: str = ""

    def __post_init__(self) -> None:
        if (self.kind == "image") != bool(self.file):
            raise ValueError(f"an image needs its file and nothing else has one; file is {self.file!r}")


class Wall(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Upright rectangles along a line of points; one that hangs clear of the base's body is no obstacle."""

    points: Points
    bottom: Height = 0.0
    top: Annotated[float, Meta(gt=0.0, le=100.0)] = 2.5
    texture: TextureConfig | None = None
    """The plan's when None, here and below."""

    def __post_init__(self) -> None:
        _check_apart("points", self.points)
        if self.top <= self.bottom:
            raise ValueError(f"top is {self.top:g}, must be above bottom = {self.bottom:g}")


class StandingBox(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A box on the floor: its middle, its extent along and across its own axis, its height."""

    x: Place
    y: Place
    length: Length
    width: Length
    height: Length
    yaw_deg: Angle = 0.0
    texture: TextureConfig | None = None


class Hole(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A rectangular pit in the floor, along the axes."""

    x: Place
    y: Place
    length: Length
    width: Length
    depth: Length = 0.5
    texture: TextureConfig | None = None


class Person(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A box that walks along a line of points from ``start`` seconds on, then stands or walks back and forth."""

    path: Points
    speed: Annotated[float, Meta(gt=0.0, le=10.0)] = 0.5
    start: Annotated[float, Meta(ge=0.0, le=1e6)] = 0.0
    back_and_forth: bool = False
    depth: Length = 0.25
    width: Length = 0.45
    height: Length = 1.75
    texture: TextureConfig | None = None

    def __post_init__(self) -> None:
        _check_apart("path", self.path)


class Mount(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Where something sits on a carrier ("world", or a base by its name) in the carrier's own axes."""

    on: str
    x: Place = 0.0
    y: Place = 0.0
    z: Place = 0.0
    yaw_deg: Angle = 0.0
    """Positive left."""
    pitch_deg: Angle = 0.0
    """Positive down."""
    roll_deg: Angle = 0.0
    """Positive right side down."""

    def placement(self) -> Placement:
        """The mount's axes (x ahead, y left, z up) in the carrier's."""
        turn = (
            rotation_about(2, radians(self.yaw_deg))
            @ rotation_about(1, radians(self.pitch_deg))
            @ rotation_about(0, radians(self.roll_deg))
        )
        return Placement(turn, np.array([self.x, self.y, self.z]))


class Panel(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A rectangle on a carrier, its face along the mount's x axis: on a wall, on a station, on a base."""

    mount: Mount
    width: Length
    height: Length
    texture: TextureConfig | None = None


class Floor(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The floor with its holes: as wide as the plan and 6 m more on every side."""

    texture: TextureConfig | None = None
    hole: list[Hole] = []


class Ceiling(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A ceiling as wide as the floor."""

    height: Height = 2.5
    texture: TextureConfig | None = None


class Flicker(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The light times 1 + amplitude sin(2 pi f t)."""

    amplitude: Annotated[float, Meta(ge=0.0, le=1.0)]
    frequency_hz: Annotated[float, Meta(gt=0.0, le=1000.0)]


class LightConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """1 is day, 0 lights out; ``gradient`` is the relative change per metre along x and y."""

    level: Annotated[float, Meta(ge=0.0, le=10.0)] = 1.0
    gradient: tuple[Annotated[float, Meta(ge=-10.0, le=10.0)], Annotated[float, Meta(ge=-10.0, le=10.0)]] = (
        0.0,
        0.0,
    )
    flicker: Flicker | None = None


class Plan(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """A world. ``texture`` is of everything that has none of its own; ``seed`` moves every pattern.

    ``middle`` is the line on which a perfect base would go, ``goal`` the line that its centre crosses at the
    end of its way: the points at its left and right then.
    """

    description: str = ""
    texture: TextureConfig = TextureConfig()
    seed: Annotated[int, Meta(ge=0)] = 0
    sky: Grey = 128.0
    light: LightConfig = LightConfig()
    floor: Floor | None = None
    ceiling: Ceiling | None = None
    wall: list[Wall] = []
    box: list[StandingBox] = []
    person: list[Person] = []
    panel: list[Panel] = []
    middle: Annotated[list[Point], Meta(min_length=2)] | None = None
    goal: tuple[Point, Point] | None = None

    def __post_init__(self) -> None:
        _check_apart("middle", self.middle or [])
        _check_apart("goal", [*(self.goal or [])])
