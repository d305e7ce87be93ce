"""A plan's surfaces as a camera sees them, against closed forms of where they are and how they are lit."""

from math import pi, radians, tan

import numpy as np
import pytest

from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.placement import Placement, facing, rotation_about
from sim_devices.worlds.plan import (
    Ceiling,
    Flicker,
    Floor,
    Hole,
    LightConfig,
    Mount,
    Panel,
    Person,
    Plan,
    StandingBox,
    TextureConfig,
    Wall,
)
from sim_devices.worlds.render import render
from sim_devices.worlds.sight import pyramid
from sim_devices.worlds.truth import depth_map, meet
from sim_devices.worlds.walls import build_world

OPTICS = Optics.centred_deg(96, 96, 60.0)
MIDDLE = Window(47, 47, 2, 2)
BARE = TextureConfig(kind="bare", mean=100.0)
AHEAD = Wall(points=[(2.0, 20.0), (2.0, -20.0)], top=20.0)
LEVEL = facing((0.0, 0.0, 0.5))
HIGH = facing((0.0, 0.0, 5.0))
"""Sees nothing but the wall."""


def ahead(texture: TextureConfig, **changes: object) -> Plan:
    """One wall 2 m ahead that fills the image."""
    return Plan(wall=[AHEAD], texture=texture, **changes)  # type: ignore[arg-type]


def depth(plan: Plan, camera: Placement = LEVEL, t: float = 0.0) -> float:
    return float(depth_map(build_world(plan), OPTICS, camera, t, MIDDLE).mean())


@pytest.mark.parametrize("contrast", [0.05, 0.5, 1.0])
def test_contrast_is_a_deviation_of_forty_grey_levels_times_it(contrast: float) -> None:
    # One period of 512 texels fills the 512 pixels.
    plan = ahead(TextureConfig(contrast=contrast, period=4.0 * tan(radians(30.0))))
    image = render(build_world(plan, seed=3), Optics.centred_deg(512, 512, 60.0), HIGH, 0.0)
    # What varies from pixel to pixel is averaged within pixels; at c = 1 both ends of the range cut 0.1 %.
    assert image.std() == pytest.approx(40.0 * contrast, rel=0.06)
    assert image.mean() == pytest.approx(128.0, abs=1.0)


def test_stripes_have_their_period_and_their_deviation() -> None:
    plan = ahead(TextureConfig(kind="stripes", period=0.2, contrast=0.5))
    row = render(build_world(plan), OPTICS, HIGH, 0.0)[48]
    assert {round(float(row.min())), round(float(row.max()))} == {108, 148}
    crossings = np.flatnonzero(np.diff(np.sign(row - 128.0)) != 0)
    # Half a period of 0.1 m is 4.16 pixels at 2 m; a crossing is known to a pixel.
    half = OPTICS.fx * 0.1 / 2.0
    assert np.diff(crossings).mean() == pytest.approx(half, abs=1.0 / (len(crossings) - 1))


def test_a_bare_wall_shows_nothing_and_posters_leave_some_of_it_bare() -> None:
    assert np.all(render(build_world(ahead(BARE)), OPTICS, HIGH, 0.0) == 100.0)
    posters = render(
        build_world(ahead(TextureConfig(kind="posters", mean=100.0, period=2.0))), OPTICS, HIGH, 0.0
    )
    assert 0.1 < np.mean(posters == 100.0) < 0.9
    assert posters.std() > 10.0


def test_a_seed_moves_every_pattern_and_gives_the_same_bytes_again() -> None:
    plan = ahead(TextureConfig())
    first, again, other = (render(build_world(plan, seed=s), OPTICS, HIGH, 0.0) for s in (1, 1, 2))
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.5


def test_walls_of_one_texture_show_different_parts_of_it() -> None:
    plan = Plan(wall=[AHEAD, Wall(points=[(-2.0, -20.0), (-2.0, 20.0)], top=20.0)])
    world = build_world(plan)
    front, back = (
        render(world, OPTICS, facing((0.0, 0.0, 5.0), heading), 0.0).ravel() for heading in (0.0, pi)
    )
    assert abs(np.corrcoef(front, back)[0, 1]) < 0.5


def test_a_pattern_goes_on_where_a_straight_wall_has_a_point() -> None:
    one = Plan(wall=[AHEAD])
    two = Plan(wall=[Wall(points=[(2.0, 20.0), (2.0, 0.3), (2.0, -20.0)], top=20.0)])
    images = [render(build_world(plan), OPTICS, HIGH, 0.0) for plan in (one, two)]
    # The samples at the joint take their mip level from other cells: less than a grey level.
    assert np.abs(images[0] - images[1]).max() < 1.0


def test_a_long_wall_is_as_sharp_at_its_end_as_at_its_beginning() -> None:
    # 900 m of 0.64 m tiles are 720 000 texels: float32 alone would know them to 0.06 texels.
    plan = Plan(wall=[Wall(points=[(-10.0, 1.0), (900.0, 1.0)])])
    world = build_world(plan)
    near, far = (render(world, OPTICS, facing((x, 0.0, 1.0), pi / 2.0), 0.0) for x in (0.0, 640.0))
    assert np.abs(near - far).max() < 1.0  # 640 m are a thousand whole tiles


def test_the_floor_lies_at_zero_and_the_ceiling_at_its_height() -> None:
    plan = Plan(floor=Floor(), ceiling=Ceiling(height=2.5))
    assert depth(plan, facing((0.0, 0.0, 0.5), 0.3, radians(40.0))) == pytest.approx(
        0.5 / np.sin(radians(40.0)), rel=1e-3
    )
    assert depth(plan, facing((0.0, 0.0, 0.5), 0.3, radians(-40.0))) == pytest.approx(
        2.0 / np.sin(radians(40.0)), rel=1e-3
    )


def test_a_hole_is_a_pit_of_its_depth_and_changes_nothing_beside_it() -> None:
    whole, holed = Plan(floor=Floor()), Plan(floor=Floor(hole=[Hole(x=1.0, y=0.2, length=0.3, width=0.4)]))
    down = facing((1.0, 0.2, 0.8), 0.0, pi / 2.0)
    depths = depth_map(build_world(holed), OPTICS, down, 0.0)
    assert depths[48, 48] == pytest.approx(1.3)  # 0.8 m above the floor, 0.5 m of pit
    edge = OPTICS.fx / 0.8
    floor = np.isclose(depths, 0.8)
    # The opening is 0.3 x 0.4 m in the plane of the floor; whole pixels at each edge.
    assert (~floor).sum() == pytest.approx(0.3 * edge * 0.4 * edge, rel=0.05)
    images = [render(build_world(plan, seed=1), OPTICS, down, 0.0) for plan in (whole, holed)]
    beside = (
        floor & np.roll(floor, 2, 0) & np.roll(floor, -2, 0) & np.roll(floor, 2, 1) & np.roll(floor, -2, 1)
    )
    assert np.abs(images[0] - images[1])[beside].max() < 1.0


def test_a_box_stands_where_it_is_put_and_no_higher() -> None:
    plan = Plan(box=[StandingBox(x=2.0, y=0.0, length=0.6, width=0.4, height=0.5, yaw_deg=90.0)])
    assert depth(plan, facing((0.0, 0.0, 0.4))) == pytest.approx(1.8)  # turned: its width lies along x
    assert np.isnan(depth(plan, facing((0.0, 0.0, 0.6))))


@pytest.mark.parametrize(
    ("t", "x"), [(0.0, 4.0), (2.0, 4.0), (4.0, 3.0), (6.0, 2.0), (8.0, 3.0), (10.0, 4.0), (12.0, 3.0)]
)
def test_a_person_walks_back_and_forth_from_his_start_on(t: float, x: float) -> None:
    person = Person(path=[(4.0, 0.0), (2.0, 0.0)], speed=0.5, start=2.0, back_and_forth=True, depth=0.2)
    assert depth(Plan(person=[person]), t=t) == pytest.approx(x - 0.1)


def test_a_person_who_arrived_stays() -> None:
    person = Person(path=[(4.0, 0.0), (3.0, 0.0), (3.0, 1.0), (2.0, 1.0)], speed=1.0, depth=0.2)
    side = facing((0.0, 1.0, 0.5))
    assert depth(Plan(person=[person]), side, 2.0) == pytest.approx(2.9, abs=0.13)  # he turns on the spot
    assert depth(Plan(person=[person]), side, 50.0) == pytest.approx(1.9)


def test_a_panel_rides_on_its_carrier() -> None:
    panel = Panel(mount=Mount(on="base", x=0.4, z=0.5), width=0.6, height=0.4)

    def base(t: float) -> Placement:
        return Placement(rotation_about(2, pi), np.array([3.0 - 0.1 * t, 0.0, 0.0]))

    world = build_world(Plan(panel=[panel]), carriers={"base": base})
    world.epoch = 5.0
    # At 3 m, looking back, its panel 0.4 m before it.
    assert depth_map(world, OPTICS, LEVEL, 5.0, MIDDLE).mean() == pytest.approx(2.6 - 0.5)
    assert depth_map(world, OPTICS, LEVEL, 10.0, MIDDLE).mean() == pytest.approx(2.6 - 1.0)


def test_a_panel_on_nothing_is_refused() -> None:
    plan = Plan(panel=[Panel(mount=Mount(on="base2"), width=0.6, height=0.4)])
    with pytest.raises(ValueError, match=r"panel\[0\]\.mount\.on = 'base2'.*there is world, base"):
        build_world(plan, carriers={"base": lambda t: Placement()})


def test_light_falls_along_its_gradient() -> None:
    world = build_world(ahead(BARE, light=LightConfig(level=0.8, gradient=(0.1, -0.2))))
    row = render(world, OPTICS, HIGH, 0.0)[48]
    columns, _ = OPTICS.rays(OPTICS.whole)
    # The wall's points are (2, -2 X/Z): 100 grey levels times 0.8 (1 + 0.1 x - 0.2 y).
    assert row == pytest.approx(80.0 * (1.2 + 0.4 * columns), abs=0.05)


def test_a_gradient_lights_a_texture_and_never_below_nothing() -> None:
    even, lit = (
        render(build_world(ahead(TextureConfig(), light=LightConfig(gradient=g))), OPTICS, HIGH, 0.0)
        for g in ((0.0, 0.0), (0.0, 1.5))
    )
    columns, _ = OPTICS.rays(OPTICS.whole)
    factor = np.maximum(1.0 - 3.0 * columns, 0.0)[None, :]
    assert (factor == 0.0).any()
    # A pixel is the mean of samples whose light differs: a few grey levels in a hundred.
    assert np.abs(lit - even * factor).max() < 6.0


def test_light_flickers_in_time() -> None:
    plan = ahead(BARE, light=LightConfig(flicker=Flicker(amplitude=0.3, frequency_hz=2.0)))
    world = build_world(plan)
    world.epoch = 1.0
    levels = [float(render(world, OPTICS, HIGH, t)[0, 0]) for t in (1.0, 1.125, 1.25, 1.375)]
    assert levels == pytest.approx([100.0, 130.0, 100.0, 70.0], abs=1e-3)


def test_surfaces_outside_the_rays_are_left_out_and_no_others() -> None:
    plan = Plan(
        wall=[AHEAD, Wall(points=[(-3.0, 1.5), (2.0, 1.5)])],
        box=[StandingBox(x=x, y=y, length=0.4, width=0.3, height=0.6) for x in (-2.0, 1.5) for y in (-1.0, 0.9)],
        floor=Floor(hole=[Hole(x=1.0, y=0.0, length=0.2, width=0.2)]),
        person=[Person(path=[(1.0, 0.5), (1.0, -0.5)])],
    )  # fmt: skip
    world, window = build_world(plan), Window(40, 50, 20, 30)
    whole, own = OPTICS.rays(OPTICS.whole), OPTICS.rays(window)
    for heading in np.arange(0.0, 2.0 * pi, 0.3):
        camera = facing((0.1, 0.2, 0.5), float(heading), 0.2)
        seen = {world.surfaces[i] for i in np.unique(meet(world, OPTICS, camera, 1.0).surface) if i >= 0}
        in_window = {
            world.surfaces[i] for i in np.unique(meet(world, OPTICS, camera, 1.0, window).surface) if i >= 0
        }
        assert seen <= set(world.within(camera, pyramid(*whole)))
        kept = set(world.within(camera, pyramid(*own)))
        assert in_window <= kept
        assert len(kept) < len(world.surfaces) - 10
