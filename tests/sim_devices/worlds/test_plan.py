"""Plans as data: what comes with the emulators, what anyone may write, and how a mistake is told."""

import re
from pathlib import Path

import cv2
import numpy as np
import pytest

from sim_devices.assembly import build_parts, read_bench
from sim_devices.config import ConfigError
from sim_devices.plan_base import base_in_plan
from sim_devices.worlds.plan import Person, Plan, TextureConfig, Wall
from sim_devices.worlds.plan_files import plan_names, read_plan

ISSUE_18 = {"corridor", "bend", "narrow", "funnel", "speed", "one-wall", "door", "room", "person"}
METHODS = {"corner", "narrow60", "dark-door", "person-towards", "person-across"}


def test_the_plans_of_the_thesis_come_with_the_emulators() -> None:
    assert set(plan_names()) == ISSUE_18 | METHODS
    assert all(read_plan(name).description for name in plan_names())


@pytest.mark.parametrize(
    ("name", "width"),
    [
        ("corridor", 1.45),
        ("bend", 1.45),
        ("corner", 1.45),
        ("one-wall", 1.45),
        ("door", 1.45),
        ("dark-door", 1.45),
        ("room", 1.45),
        ("narrow", 1.0),
        ("narrow60", 1.0),
        ("speed", 1.65),
        ("funnel", 2.0),
        ("person", 2.4),
        ("person-towards", 2.4),
        ("person-across", 2.4),
    ],
)
def test_a_base_of_0_70_m_stands_in_the_middle_of_each(name: str, width: float) -> None:
    plan = read_plan(name)
    truth = base_in_plan(plan, cameras=()).witness.at(0.0)
    assert truth.clearance == pytest.approx(width / 2.0 - 0.35, abs=1e-9)
    assert truth.off_middle == (None if plan.middle is None else pytest.approx(0.0))
    assert truth.past_goal is False
    assert not truth.touched


@pytest.mark.parametrize(("name", "angle_deg", "half"), [("bend", 45.0, 0.725), ("narrow", 45.0, 0.5),
                                                         ("narrow60", 60.0, 0.5), ("corner", 90.0, 0.725)])  # fmt: skip
def test_behind_a_bend_both_walls_are_as_far_from_the_middle(
    name: str, angle_deg: float, half: float
) -> None:
    plan = read_plan(name)
    assert plan.middle is not None
    (_, turn, end), angle = (np.array(p) for p in plan.middle), np.radians(angle_deg)
    assert np.arctan2(*(end - turn)[::-1]) == pytest.approx(angle, abs=1e-3)
    for wall, side in zip(plan.wall, (1.0, -1.0), strict=True):
        along, left = np.array([np.cos(angle), np.sin(angle)]), np.array([-np.sin(angle), np.cos(angle)])
        for point in wall.points[1:]:
            # Millimetres in the files.
            assert (np.array(point) - turn) @ left == pytest.approx(side * half, abs=2e-3)
        assert (np.array(wall.points[-1]) - np.array(wall.points[-2])) @ along > 3.0


def test_a_plan_may_be_written_by_anyone_with_pictures_beside_it(tmp_path: Path) -> None:
    cv2.imwrite(str(tmp_path / "bark.png"), np.full((8, 8), 50, np.uint8))
    path = tmp_path / "mine.toml"
    path.write_text(
        """
        texture = { kind = "stripes", period = 0.02 }
        sky = 0
        [light]
        gradient = [0.1, 0.0]
        flicker = { amplitude = 0.3, frequency_hz = 3.1 }
        [floor]
        hole = [{ x = 2.0, y = 0.0, length = 0.3, width = 0.3 }]
        [ceiling]
        height = 3.0
        [[wall]]
        points = [[-1.0, 1.0], [4.0, 1.0], [4.0, -1.0]]
        texture = { kind = "image", file = "bark.png", period = 1.0 }
        [[box]]
        x = 1.0
        y = -0.8
        length = 0.3
        width = 0.3
        height = 0.1
        [[person]]
        path = [[5.0, 0.0], [6.0, 0.0]]
        [[panel]]
        mount = { on = "base", x = 0.4, z = 0.5 }
        width = 0.6
        height = 0.4
        """
    )
    plan = read_plan(path, contrast=0.2)
    assert plan.texture == TextureConfig(kind="stripes", period=0.02, contrast=0.2)
    assert plan.wall[0].texture == TextureConfig(kind="image", file=str(tmp_path / "bark.png"), period=1.0)
    assert len(base_in_plan(plan).world.world.surfaces) > 20


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[[wall]]\npoints = [[0, 0]]", "wall[0].points: expected `array` of length >= 2"),
        ("[[wall]]\npoints = [[0, 0], [0, 0]]", "wall[0]: points[0] and [1] are both [0.0, 0.0], must be apart"),
        ("[[wall]]\npoints = [[0, 0], [nan, 1]]", "wall[0].points[1][0] = nan: expected `float` >= -1000.0"),
        ("[[wall]]\npoints = [[0, 0], [1, 1]]\ntop = 0.5\nbottom = 1", "wall[0]: top is 0.5, must be above"),
        ("[[wal]]\npoints = [[0, 0], [1, 1]]", "unknown field `wal`; there are description, texture"),
        ("[texture]\ncontrast = 9", "texture.contrast = 9: expected `float` <= 3.0"),
        ("[texture]\nkind = 'wool'", "texture.kind = 'wool': invalid enum value"),
        ("[texture]\nkind = 'image'\nfile = 'no.png'", "texture.file = 'no.png': there is no such picture"),
        ("[texture]\nkind = 'image'", "texture: an image needs its file"),
        ("[[person]]\npath = [[0, 0], [1, 0]]\nspeed = -1", "person[0].speed = -1: expected `float` > 0.0"),
        ("[light.flicker]\namplitude = 2\nfrequency_hz = 1", "light.flicker.amplitude = 2: expected `float` <= 1.0"),
        ("goal = [[0, 0], [0, 0]]", "goal[0] and [1] are both [0.0, 0.0], must be apart"),
        ("wall = ", "Invalid value"),
    ],
)  # fmt: skip
def test_a_mistake_in_a_plan_is_one_line_with_file_key_and_value(
    tmp_path: Path, text: str, message: str
) -> None:
    path = tmp_path / "plan.toml"
    path.write_text(text)
    with pytest.raises(ConfigError) as caught:
        read_plan(path)
    assert str(caught.value).startswith(f"{path}: ")
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_examples_of_the_manual_can_be_read(tmp_path: Path) -> None:
    manual = Path(__file__).parents[3] / "docs" / "worlds.md"
    head, plan, bench = re.findall(r"```toml\n(.*?)```", manual.read_text(encoding="utf-8"), re.DOTALL)
    for name, text in (("head", head), ("plan", plan), ("bench", bench)):
        (tmp_path / f"{name}.toml").write_text(text)
    assert read_plan(tmp_path / "plan.toml").box
    assert list(build_parts(read_bench(tmp_path / "head.toml"), 1)) == ["head", "world", "base"]
    assert list(build_parts(read_bench(tmp_path / "bench.toml"), 1)["world"].cameras) == ["left"]  # type: ignore[attr-defined]


def test_an_unknown_name_is_answered_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match=r"no plan is called 'coridor'; there are bend, corner, corridor, "):
        read_plan("coridor")
    with pytest.raises(ConfigError, match=r"none\.toml: No such file"):
        read_plan("none.toml")


def test_a_contrast_out_of_range_names_its_range() -> None:
    with pytest.raises(ConfigError, match=r"texture\.contrast = -1\.0: expected `float` >= 0\.0"):
        read_plan("corridor", contrast=-1.0)


@pytest.mark.parametrize(
    "wrong", [lambda: Wall(points=[(0.0, 0.0), (0.0, 0.0)]), lambda: Person(path=[(1.0, 1.0), (1.0, 1.0)])]
)
def test_a_program_cannot_make_a_way_of_no_length_either(wrong: object) -> None:
    with pytest.raises(ValueError, match="must be apart"):
        wrong()  # type: ignore[operator]


def test_a_base_that_would_stand_in_a_wall_is_refused() -> None:
    plan = Plan(wall=[Wall(points=[(0.2, -1.0), (0.2, 1.0)])])
    with pytest.raises(ValueError, match="base at x = 0, y = 0 stands in a wall"):
        base_in_plan(plan)
