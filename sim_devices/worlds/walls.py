"""A plan as surfaces: walls, boxes, people, and panels on their carriers."""

from collections.abc import Iterator, Mapping
from dataclasses import replace
from itertools import pairwise
from math import atan2, hypot, pi, radians

import numpy as np

from sim_devices.worlds.ground import ground
from sim_devices.worlds.paint import Painter
from sim_devices.worlds.placement import (
    Motion,
    Placement,
    Still,
    facing,
    mounted,
    rotation_about,
    sine,
    still,
)
from sim_devices.worlds.plan import Panel, Person, Plan, TextureConfig, Wall
from sim_devices.worlds.surface import Rectangle, box
from sim_devices.worlds.texture import plain
from sim_devices.worlds.walk import Walk
from sim_devices.worlds.world import World

WORLD = "world"
"""The carrier that never moves."""


def build_world(plan: Plan, *, seed: int = 0, carriers: Mapping[str, Motion] | None = None) -> World:
    """The plan's world; ``carriers`` are what its panels may sit on, by name, at times of the loop's clock.

    Raises ValueError when a panel sits on none of them or a picture cannot be read.
    """
    light = plan.light
    world = World(sky=plan.sky, light=light.level, gradient=(*light.gradient, 0.0))
    if light.flicker is not None:
        world.flicker = sine(light.flicker.amplitude, light.flicker.frequency_hz, mean=1.0)
    painter = Painter(plan.texture, plan.seed + seed)
    for wall in plan.wall:
        world.extend(_upright(wall, painter))
    for standing in plan.box:
        place = Placement(
            rotation_about(2, radians(standing.yaw_deg)),
            np.array([standing.x, standing.y, standing.height / 2.0]),
        )
        size = standing.length, standing.width, standing.height
        world.extend(_faces(size, still(place), standing.texture, painter))
    world.extend(ground(plan, painter))
    for n, panel in enumerate(plan.panel):
        carrier = carrier_of(panel.mount.on, carriers or {}, f"panel[{n}].mount.on")
        world.add(_picture(panel, painter, _since_epoch(carrier, world)))
    for person in plan.person:
        size = person.depth, person.width, person.height
        world.extend(_faces(size, _walking(person), person.texture, painter))
    return world


def carrier_of(name: str, carriers: Mapping[str, Motion], key: str) -> Motion:
    """The carrier of that name; raises ValueError that names the configuration's key."""
    if name == WORLD:
        return still(Placement())
    if name not in carriers:
        raise ValueError(
            f"{key} = {name!r}: there is no such carrier; there is {', '.join([WORLD, *carriers])}"
        )
    return carriers[name]


def _upright(wall: Wall, painter: Painter) -> Iterator[Rectangle]:
    height = wall.top - wall.bottom
    across, down = painter.anywhere(wall.texture)
    for (x1, y1), (x2, y2) in pairwise(wall.points):
        length = hypot(x2 - x1, y2 - y1)
        # Upright for someone who has the first point at his left.
        place = facing(
            ((x1 + x2) / 2.0, (y1 + y2) / 2.0, (wall.top + wall.bottom) / 2.0),
            atan2(y2 - y1, x2 - x1) + pi / 2.0,
        )
        yield Rectangle(length, height, painter(wall.texture, (length, height), (across, down)), still(place))
        across += length


def _faces(
    size: tuple[float, float, float], motion: Motion, texture: TextureConfig | None, painter: Painter
) -> Iterator[Rectangle]:
    for face in box(size, plain(0.0), motion):
        offset = painter.anywhere(texture)
        yield replace(face, painting=painter(texture, (face.width, face.height), offset))


def _picture(panel: Panel, painter: Painter, carrier: Motion) -> Rectangle:
    size = panel.width, panel.height
    # Who looks at it looks against the mount's x axis.
    place = panel.mount.placement() @ facing((0.0, 0.0, 0.0), pi)
    return Rectangle(*size, painter(panel.texture, size), mounted(carrier, place))


def _walking(person: Person) -> Motion:
    way = Walk(person)

    def at(t: float) -> Placement:
        x, y, heading = way.at(t)
        return Placement(rotation_about(2, heading), np.array([x, y, person.height / 2.0]))

    return at


def _since_epoch(carrier: Motion, world: World) -> Motion:
    """A carrier knows the loop's time, a surface the seconds since the world began."""
    if isinstance(carrier, Still):
        return carrier
    return lambda t: carrier(world.epoch + t)
