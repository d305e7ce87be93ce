"""A base among the walls of a plan: bumpers meet what cameras see, and the witness knows how it was."""

import asyncio
from math import cos, radians, sin

import numpy as np
import pytest

from sim_devices.bench import Bench
from sim_devices.camera import Picture
from sim_devices.carried import carried_camera, motion_of, side_eyes
from sim_devices.clock import run_virtual
from sim_devices.head import HeadMachine
from sim_devices.labmate import BaseConfig
from sim_devices.plan_base import BaseInPlan, base_in_plan
from sim_devices.stereo import StereoWorld
from sim_devices.worlds.config import CarriedCameraConfig, TargetConfig, WorldConfig
from sim_devices.worlds.optics import Optics
from sim_devices.worlds.placement import mounted
from sim_devices.worlds.plan import Floor, Hole, Mount, Panel, Person, Plan, StandingBox, Wall
from sim_devices.worlds.plan_files import read_plan
from sim_devices.worlds.truth import depth_map

WINDOW = (96, 112, 64, 32)


def drive(stage: BaseInPlan, speed: float, turn_rate: float, until: float) -> None:
    motion = stage.machine.base.motion
    motion.drive(speed, turn_rate, 100.0)
    stage.machine.pose(until)


def start(x: float, y: float, heading_deg: float = 0.0) -> BaseConfig:
    return BaseConfig(
        start_x=x, start_y=y, start_heading_deg=heading_deg, wheel_base=0.34, diameter_ratio=1.0
    )


@pytest.mark.parametrize("heading_deg", [0.0, 20.0, -50.0])
def test_clearance_is_that_of_the_turned_body_and_not_of_a_circle(heading_deg: float) -> None:
    stage = base_in_plan(read_plan("corridor"), cameras=(), config=start(0.0, 0.05, heading_deg))
    angle = abs(radians(heading_deg))
    # Half the extent of a rectangle of 0.75 x 0.70 m across the corridor.
    reach = 0.375 * sin(angle) + 0.35 * cos(angle)
    truth = stage.witness.at(0.0)
    assert truth.clearance == pytest.approx(0.725 - 0.05 - reach)
    assert truth.off_middle == pytest.approx(0.05)
    assert (truth.x, truth.y, truth.heading) == pytest.approx((0.0, 0.05, radians(heading_deg)))


def test_the_wall_that_the_eyes_see_is_the_wall_that_stops_the_base() -> None:
    ahead = CarriedCameraConfig(name="ahead", mount=Mount(on="base", x=0.375, z=0.2))
    plan = Plan(wall=[Wall(points=[(1.5, 2.0), (1.5, -2.0)])])
    stage = base_in_plan(plan, cameras=[ahead], config=start(0.0, 0.0))
    camera = stage.world.cameras["ahead"]
    seen = depth_map(stage.world.world, camera.optics, camera.pose(0.0), 0.0)[128, 128]
    assert seen == pytest.approx(stage.witness.at(0.0).clearance) == pytest.approx(1.125)
    drive(stage, 0.25, 0.0, 10.0)
    truth = stage.witness.at(10.0)
    assert truth.touched
    assert truth.clearance == 0.0
    assert 1.125 <= truth.x < 1.125 + 0.015  # the frame stands behind 15 mm of bumper
    assert stage.machine.state()["bumpers"] == ["front"]


def test_a_box_a_low_one_a_panel_and_a_hole_are_in_the_way_each_as_it_is() -> None:
    def clearance(plan: Plan) -> float:
        return base_in_plan(plan, cameras=(), config=start(0.0, 0.0)).witness.at(0.0).clearance

    box = StandingBox(x=1.0, y=0.0, length=0.25, width=0.2, height=0.5)
    assert clearance(Plan(box=[box])) == pytest.approx(0.5)
    low = StandingBox(x=1.0, y=0.0, length=0.25, width=0.2, height=0.02)
    assert clearance(Plan(box=[low])) == pytest.approx(0.5)
    hanging = Wall(points=[(1.0, -1.0), (1.0, 1.0)], bottom=0.5)
    assert clearance(Plan(wall=[hanging])) == np.inf
    hole = Hole(x=1.0, y=0.0, length=0.25, width=0.2)
    assert clearance(Plan(floor=Floor(hole=[hole]))) == pytest.approx(0.5)
    person = Person(path=[(1.0, 0.0), (2.0, 0.0)], depth=0.25)
    assert clearance(Plan(person=[person])) == pytest.approx(0.5)


def test_a_low_box_meets_the_frame_and_no_bumper() -> None:
    plan = Plan(box=[StandingBox(x=1.0, y=0.0, length=0.25, width=0.2, height=0.02)])
    stage = base_in_plan(plan, cameras=(), config=start(0.0, 0.0))
    drive(stage, 0.25, 0.0, 10.0)
    assert stage.witness.at(10.0).touched
    assert stage.machine.state()["stalled"]
    assert stage.machine.state()["bumpers"] == []


def test_a_person_of_the_plan_is_at_the_same_place_for_eye_and_bumper() -> None:
    person = Person(path=[(4.0, 0.0), (0.0, 0.0)], speed=0.5, depth=0.2)
    ahead = CarriedCameraConfig(name="ahead", mount=Mount(on="base", x=0.375, z=1.0))
    stage = base_in_plan(Plan(person=[person]), cameras=[ahead], config=start(0.0, 0.0))
    stage.world.power_up(0.0)
    camera = stage.world.cameras["ahead"]
    for t in (0.0, 2.0, 6.0):
        seen = depth_map(stage.world.world, camera.optics, camera.pose(t), t)[128, 128]
        assert (
            seen == pytest.approx(stage.witness.at(t).clearance) == pytest.approx(4.0 - 0.1 - 0.375 - 0.5 * t)
        )
    assert not stage.witness.at(7.0).touched
    assert stage.witness.at(7.1).touched


def test_the_goal_is_crossed_by_the_centre_and_the_middle_bends_with_the_corridor() -> None:
    plan = read_plan("bend")
    assert plan.middle is not None
    turn = np.array(plan.middle[1])
    along = np.array(plan.middle[2]) - turn
    along /= np.hypot(*along)
    left = np.array([-along[1], along[0]])
    for way, past in ((1.9, False), (2.1, True)):
        x, y = (turn + way * along + 0.1 * left).tolist()
        truth = base_in_plan(plan, cameras=(), config=start(x, y, 45.0)).witness.at(0.0)
        assert truth.past_goal is past
        assert truth.off_middle == pytest.approx(0.1, abs=1e-3)
        assert truth.clearance == pytest.approx(0.725 - 0.1 - 0.35, abs=2e-3)


def run_loop(seed: int, seconds: float) -> tuple[list[Picture], list[float]]:
    """Through a bend's beginning on a bench in virtual time: pictures in the order of arrival, and clearances."""

    async def main() -> tuple[list[Picture], list[float]]:
        stage = base_in_plan(read_plan("bend"), cameras=side_eyes(window=WINDOW, latency_ms=30.0), seed=seed)
        loop = asyncio.get_running_loop()
        pictures: list[Picture] = []
        async with Bench(stage.parts, seed=seed):
            for camera in stage.world.cameras.values():
                camera.deliver_to(pictures.append)
            stage.world.start()
            stage.machine.base.motion.drive(0.08, 0.02, seconds)
            clearances = []
            for _ in range(round(seconds * 12.5)):
                await asyncio.sleep(0.08)
                clearances.append(stage.witness.at(loop.time()).clearance)
            stage.world.stop()
        return pictures, clearances

    return run_virtual(main())


def test_two_runs_of_a_seed_give_the_same_bytes_at_the_same_times() -> None:
    (first, ways), (again, same_ways), (other, _) = run_loop(1, 2.0), run_loop(1, 2.0), run_loop(2, 2.0)
    assert ways == same_ways
    assert [p.stamp for p in first] == [p.stamp for p in again]
    assert all(np.array_equal(a.image, b.image) for a, b in zip(first, again, strict=True))
    assert not np.array_equal(first[0].image, other[0].image)
    assert first[0].image.shape == (32, 64)
    # 25 exposures of two eyes; the last is still on its way.
    assert len(first) == 48
    assert np.diff([p.stamp for p in first[::2]]) == pytest.approx([0.08] * 23)


def test_one_world_holds_a_base_with_its_eyes_and_a_head_that_stands_on_it() -> None:
    stage = base_in_plan(read_plan("corridor"), config=start(0.0, 0.0, 90.0))
    head = HeadMachine(seed=1)
    stand = mounted(motion_of(stage.machine), Mount(on="base", x=0.1, z=1.0).placement())
    seen = StereoWorld(
        WorldConfig(target=TargetConfig(kind="none")),
        lambda t: dict.fromkeys(head.joint_angles(t), 0.0),
        stand=stand,
        world=stage.world.world,
    )
    eye = seen.pose("left", 0.0)
    # It looks along y, the baseline of 0.13 m across it.
    assert eye.rotation[:, 2] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert eye.position == pytest.approx([-0.065, 0.1, 1.0])
    depth = depth_map(stage.world.world, Optics.centred_deg(9, 9, 40.0), eye, 0.0)
    assert depth[4, 4] == pytest.approx(0.725 - 0.1)
    assert {id(camera.world) for camera in (*seen.cameras.values(), *stage.world.cameras.values())} == {
        id(stage.world.world)
    }


def test_a_station_watches_the_panel_of_a_blind_base() -> None:
    panel = Panel(mount=Mount(on="base", x=0.375, z=0.6), width=0.6, height=0.6)
    station = CarriedCameraConfig(
        name="station", mount=Mount(on="world", x=3.0, z=0.6, yaw_deg=180.0), noise=0.0
    )
    stage = base_in_plan(Plan(panel=[panel], sky=0.0), cameras=[station], config=start(0.0, 0.0))
    widths = []
    for t in (0.0, 8.0):
        drive(stage, 0.1, 0.0, t)
        image = stage.world.cameras["station"].expose([t], 0).image
        widths.append(int((image[128] > 20).sum()))
    gone = stage.machine.pose(8.0).x
    assert widths == pytest.approx([192.0 * 0.6 / 2.625, 192.0 * 0.6 / (2.625 - gone)], abs=1.5)


def test_cameras_of_one_world_have_names_of_their_own() -> None:
    stage = base_in_plan(read_plan("corridor"))
    with pytest.raises(ValueError, match="two cameras 'left'"):
        stage.world.mount(stage.world.cameras["left"])
    stranger = carried_camera(
        side_eyes(name="third")[0], base_in_plan(Plan()).world.world, {"base": motion_of(stage.machine)}
    )
    with pytest.raises(ValueError, match="'third' is in another world"):
        stage.world.mount(stranger)


def test_incidents_reach_a_camera_by_its_name() -> None:
    stage = base_in_plan(read_plan("corridor"), cameras=side_eyes(window=WINDOW))
    stage.world.verbs["dark"]("left", True)
    stage.world.verbs["delay"]("right", 0.2)
    state = stage.world.state()["cameras"]
    assert state["left"]["dark"]
    assert state["right"]["delay"] == 0.2
    with pytest.raises(ValueError, match="no 'third' camera; there is left, right"):
        stage.world.verbs["dark"]("third", True)
    assert stage.world.cameras["left"].expose([0.0], 0).image.max() < 20  # noise of two grey levels
