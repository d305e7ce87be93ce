"""What of a plan is in a base's way: the same walls, boxes and people that its cameras see."""

from itertools import pairwise
from math import degrees

import msgspec

from sim_devices.labmate import BaseConfig, Box
from sim_devices.labmate.floor import Floor, Walker
from sim_devices.worlds.plan import Plan
from sim_devices.worlds.walk import Walk
from sim_devices.worlds.world import World

BODY_HEIGHT = 0.28
"""Of the base (its page): what hangs higher is not in its way."""
BUMPER_HEIGHT = 0.06
"""Ours, the page gives none: a lower box passes under the bumpers."""


def between_walls(config: BaseConfig, plan: Plan) -> BaseConfig:
    """The base with the plan's walls and boxes about it, beside its own."""
    walls = [
        (*here, *there)
        for wall in plan.wall
        if wall.bottom < BODY_HEIGHT
        for here, there in pairwise(wall.points)
    ]
    boxes = [
        Box(box.x, box.y, box.length, box.width, box.yaw_deg, low=box.height < BUMPER_HEIGHT)
        for box in plan.box
    ]
    return msgspec.structs.replace(config, walls=[*config.walls, *walls], boxes=[*config.boxes, *boxes])


def walkers(plan: Plan, world: World) -> list[Walker]:
    """The plan's people as obstacles, in the time of a world built from the plan."""
    return [_walker(Walk(person), person.depth, person.width, person.speed, world) for person in plan.person]


def pits(plan: Plan) -> Floor:
    """The plan's holes as a floor of their own: no bumper meets them, and a base that comes to one is lost."""
    holes = plan.floor.hole if plan.floor is not None else []
    return Floor(boxes=[Box(hole.x, hole.y, hole.length, hole.width) for hole in holes])


def _walker(walk: Walk, depth: float, width: float, speed: float, world: World) -> Walker:
    def outline(t: float) -> Box:
        x, y, heading = walk.at(world.elapsed(t))
        return Box(x, y, depth, width, degrees(heading))

    return Walker(outline, speed)
