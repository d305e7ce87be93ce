"""Bases in a plan: the walls that their bumpers meet are the walls that their cameras see."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from sim_devices.bench import Part
from sim_devices.carried import carried_camera, motion_of, side_eyes
from sim_devices.labmate import BaseConfig, BaseMachine
from sim_devices.obstacles import between_walls, walkers
from sim_devices.rendered import RenderedWorld
from sim_devices.witness import Witness
from sim_devices.worlds.config import CarriedCameraConfig
from sim_devices.worlds.plan import Plan
from sim_devices.worlds.walls import build_world
from sim_devices.worlds.world import World


@dataclass(frozen=True)
class BaseInPlan:
    """A base, the world that its cameras see, and the witness of both."""

    machine: BaseMachine
    world: RenderedWorld
    witness: Witness

    @property
    def parts(self) -> dict[str, Part]:
        """What goes on the bench."""
        return {"base": self.machine, "world": self.world}


def base_in_plan(
    plan: Plan,
    *,
    cameras: Sequence[CarriedCameraConfig] | None = None,
    config: BaseConfig | None = None,
    seed: int = 0,
) -> BaseInPlan:
    """A base that stands at the plan's origin, or where its configuration says, and carries ``cameras``.

    Without any it has the side eyes. Raises ValueError of one line: the base stands in a wall, a camera or a
    panel has an unknown carrier.
    """
    machine = BaseMachine(between_walls(config or BaseConfig(), plan), seed)
    world = world_of_bases(plan, {"base": machine}, seed=seed)
    carriers = {"base": motion_of(machine)}
    eyes = side_eyes() if cameras is None else cameras
    rendered = RenderedWorld(world)
    for eye in eyes:
        rendered.mount(carried_camera(eye, world, carriers, seed=seed), eye.port)
    return BaseInPlan(machine, rendered, Witness(machine, plan))


def world_of_bases(plan: Plan, machines: Mapping[str, BaseMachine], *, seed: int = 0) -> World:
    """The plan's world with its people about the bases; raises ValueError when a base stands in a wall."""
    world = build_world(plan, seed=seed, carriers={name: motion_of(m) for name, m in machines.items()})
    people = walkers(plan, world)
    for name, machine in machines.items():
        machine.let_walk(people)
        if machine.clearance(0.0) == 0.0:
            x, y, _ = machine.pose(0.0)
            raise ValueError(
                f"{name} at x = {x:g}, y = {y:g} stands in a wall, a box or a person of the plan"
            )
    return world
