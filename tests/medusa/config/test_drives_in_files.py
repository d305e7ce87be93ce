"""A configuration names its drive; joints have the names and the number that the file gives them."""

import re
from pathlib import Path

import pytest

from medusa.config.file import load_config, parse_config, template
from medusa.errors import CommandError, ConfigError
from medusa.ideal.config import IdealConfig
from medusa.machines import open_head
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.simulated_config import simulated_toml


def test_a_file_without_a_drive_is_for_mc3000_boards_and_one_that_names_it_is_the_same() -> None:
    plain = parse_config(simulated_toml(), "head.toml")
    named = parse_config('drive = "mc3000"\n' + simulated_toml(), "head.toml")
    assert isinstance(plain, Mc3000Config)
    assert named == plain


def test_an_unknown_drive_is_refused_with_those_there_are() -> None:
    with pytest.raises(ConfigError, match=r"head\.toml: drive = 'xl330': one of 'mc3000', 'ideal'"):
        parse_config('drive = "xl330"\n', "head.toml")
    with pytest.raises(ConfigError, match=r"drive = 3: one of"):
        parse_config("drive = 3\n", "head.toml")


def test_the_ideal_heads_template_is_complete() -> None:
    config = parse_config(template("ideal"), "ideal.toml")
    assert isinstance(config, IdealConfig)
    assert list(config.traits) == ["pan", "tilt", "left_vergence", "right_vergence"]


@pytest.mark.parametrize(
    ("before", "after", "told"),
    [
        ("soft_min_deg = -93.0", "soft_min_deg = 100.0", r"axes\.pan\.soft_min_deg = 100\.0: less than"),
        ("park_deg = 0.0", "park_deg = 95.0", r"axes\.pan\.park_deg = 95\.0: between the soft limits"),
        ("watchdog_ms = 400", "watchdog_ms = 0", r"watchdog_ms = 0: an integer from 50 to 5000"),
        ("max_speed_deg_s = 111.6", 'max_speed_deg_s = "x"', r"axes\.tilt\.max_speed_deg_s = 'x': a number"),
        ("watchdog_ms = 400\n", "", r"watchdog_ms is missing"),
    ],
)
def test_a_mistake_in_an_ideal_head_is_one_line(before: str, after: str, told: str) -> None:
    text = template("ideal")
    assert before in text
    with pytest.raises(ConfigError, match=told):
        parse_config(text.replace(before, after, 1), "ideal.toml")


async def test_an_ideal_head_has_no_ports(tmp_path: Path) -> None:
    path = tmp_path / "ideal.toml"
    path.write_text(template("ideal"))
    config = load_config(path)
    with pytest.raises(CommandError, match="has no ports"):
        async with open_head(config, "/dev/ttyUSB0"):
            pass
    async with open_head(config) as head:
        await head.home()
        assert (await head.move({"pan": 0.5})).all_settled


async def test_a_head_has_the_joints_that_its_file_names(tmp_path: Path) -> None:
    text = template("ideal")
    two = text[: text.index("[axes.left_vergence]")].replace("[axes.tilt]", "[axes.nod]")
    config = parse_config(two, "ideal.toml")
    async with open_head(config) as head:
        await head.home()
        assert list(head.traits) == ["pan", "nod"]
        await head.move({"nod": 0.1})
        with pytest.raises(CommandError, match="there is no joint 'tilt'; the head has pan, nod"):
            await head.move({"tilt": 0.1})


def test_a_joint_of_an_mc3000_head_may_be_named_and_left_out() -> None:
    text = re.sub(r"\[axes\.(left|right)_vergence.*", "", simulated_toml(), flags=re.S)
    text = text.replace(
        'order = [["tilt"], ["left_vergence", "right_vergence"], ["pan"]]', 'order = [["tilt"], ["pan"]]'
    )
    config = parse_config(text, "head.toml")
    assert isinstance(config, Mc3000Config)
    assert list(config.axes) == ["pan", "tilt"]
    with pytest.raises(ConfigError, match=r"axes\.Neck = 'Neck': a joint's name is of lower-case"):
        parse_config(text.replace("axes.pan", "axes.Neck").replace('["pan"]', '["Neck"]'), "head.toml")
