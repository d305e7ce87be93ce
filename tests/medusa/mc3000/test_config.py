"""The configuration file: what it holds, what it refuses in one line, and writing single keys back."""

import math
from pathlib import Path

import pytest

from medusa.config.file import load_config, parse_config, template, write_keys
from medusa.errors import ConfigError
from medusa.mc3000.board import FilterBytes, Mode
from medusa.mc3000.simulated_config import simulated_config, simulated_toml, simulated_values


def refusal(text: str) -> str:
    with pytest.raises(ConfigError) as refused:
        parse_config(text, "head.toml")
    assert "\n" not in str(refused.value)
    assert refused.value.file == "head.toml"
    return str(refused.value)


def changed(before: str, after: str) -> str:
    text = simulated_toml()
    assert before in text
    return text.replace(before, after, 1)


def test_the_simulated_head_has_the_scales_of_the_thesis() -> None:
    config = simulated_config()
    # E of thesis (6.7): 18482.5, 31831.0 and 15915.5 counts/rad; the keys carry six digits.
    assert config.axes["left_vergence"].counts_per_radian == pytest.approx(18482.5, rel=1e-6)
    assert config.axes["tilt"].counts_per_radian == pytest.approx(31831.0, rel=1e-6)
    assert config.axes["pan"].counts_per_radian == pytest.approx(15915.5, rel=1e-6)
    assert [config.axes[name].sign for name in ("left_vergence", "right_vergence")] == [1, -1]


def test_the_simulated_head_keeps_two_degrees_from_its_switches() -> None:
    config = simulated_config()
    # Stops at ±100° and ±45°, switches 5° inside, soft limits 2° inside those (docs/protocols, MC3000).
    for name, stop in (("pan", 100), ("tilt", 45), ("left_vergence", 45), ("right_vergence", 45)):
        assert config.axes[name].soft_limits == pytest.approx(
            (math.radians(7 - stop), math.radians(stop - 7))
        )


def test_the_simulated_filters_are_the_nearest_registers() -> None:
    axes = simulated_config().axes
    assert axes["pan"].filters.of(Mode.POSITION).filter == FilterBytes(197, 0, 7, 255)
    assert axes["tilt"].filters.of(Mode.POSITION).filter == FilterBytes(220, 0, 5, 255)
    assert axes["left_vergence"].filters.of(Mode.INTEGRAL_VELOCITY).filter == FilterBytes(225, 0, 5, 255)
    assert axes["pan"].filters.of(Mode.PROPORTIONAL_VELOCITY).filter.K == 15
    assert axes["pan"].filters.position.sample_period == pytest.approx(2.048e-3)


def test_the_template_leaves_every_hazardous_key_empty() -> None:
    text = refusal(template())
    assert (
        text
        == "head.toml: axes.pan.counts_per_degree = '': has to be filled in: a number from more than 0 to 20000"
    )
    filled = {key.split(".", 2)[2] for key in simulated_values()}
    assert {"sign", "counts_per_degree", "soft_min_deg", "soft_max_deg", "max_speed_deg_s"} <= filled
    assert {"following_limit_deg", "home_edge_deg", "filters.position.K"} <= filled


@pytest.mark.parametrize(
    ("before", "after", "reported"),
    [
        ("sign = -1", "sign = 2", "axes.right_vergence.sign = 2: one of -1, 1"),
        ("sign = -1\n", "", "axes.right_vergence.sign is missing: one of -1, 1"),
        ("sign = -1", "sing = -1", "axes.right_vergence.sing = -1: no such key is known"),
        ("A = 220", "A = 256", "axes.tilt.filters.position.A = 256: an integer from 0 to 255"),
        ("A = 220", "A = 0.5", "axes.tilt.filters.position.A = 0.5: an integer from 0 to 255"),
        ("soft_min_deg = -93.0", "soft_min_deg = nan", "soft_min_deg = nan: a number from -180 to 180"),
        ("soft_min_deg = -93.0", "soft_min_deg = 94.0", "soft_min_deg = 94.0: less than soft_max_deg, 93"),
        ("park_deg = 0.0", "park_deg = 95.0", "axes.pan.park_deg = 95.0: between the soft limits, -93 to 93"),
        (
            "following_limit_deg = 5.0",
            "following_limit_deg = 0",
            "following_limit_deg = 0: a number from more",
        ),
        ("following_limit_deg = 5.0", "following_limit_deg = 0.001", "1 to 65535 counts"),
        ("max_speed_deg_s = 111.6", "max_speed_deg_s = 180", "204.80 counts a sample at T=255; the chip"),
        (
            "approach_speed_deg_s = 1.8",
            "approach_speed_deg_s = 0.5",
            "approach_speed_deg_s = 0.5: a speed of",
        ),
        ("board_watchdog_ms = 400", "board_watchdog_ms = 2900", "more than 3107 ms, the board's watchdog"),
        ("channel = 2", "channel = 1", "axes.right_vergence.channel = 1: not that of tilt on board 1"),
        ("amplifier = 3", "amplifier = 4", "axes.tilt.amplifier = 4: not that of pan"),
        ('[["tilt"]', '[["pan"]', "every one of pan, tilt, left_vergence, right_vergence exactly once"),
        ("baud = 115200", "baud = 1200", "ports.baud = 1200: one of 9600"),
        ("baud = 115200", "baud = ", "is not TOML: Invalid value (at line"),
        ("T = 255 }\nprop", "T = 14 }\nprop", "axes.pan.filters.position.T = 14: at least 15: profiles"),
    ],
)
def test_a_mistake_is_reported_in_one_line_with_key_value_and_what_is_allowed(
    before: str, after: str, reported: str
) -> None:
    assert reported in refusal(changed(before, after))


def test_joints_of_one_board_have_equal_timers() -> None:
    text = changed(
        "position = { A = 220, B = 0, K = 5, T = 255 }", "position = { A = 220, B = 0, K = 5, T = 200 }"
    )
    assert "only with equal timers" in refusal(
        text.replace("max_speed_deg_s = 111.6", "max_speed_deg_s = 100")
    )


def test_a_missing_file_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file or directory$"):
        load_config(tmp_path / "none.toml")


def test_the_file_of_a_configuration_is_known(tmp_path: Path) -> None:
    path = tmp_path / "head.toml"
    path.write_text(simulated_toml())
    assert load_config(path).file == str(path)
    assert simulated_config().file is None


def test_single_keys_are_written_back_and_comments_kept(tmp_path: Path) -> None:
    path = tmp_path / "head.toml"
    path.write_text(simulated_toml())
    config = write_keys(path, {"axes.tilt.filters.position.K": 4, "axes.tilt.filters.position.A": 221})
    assert config.axes["tilt"].filters.position.filter == FilterBytes(221, 0, 4, 255)
    before, after = simulated_toml().splitlines(), path.read_text().splitlines()
    differing = [(a, b) for a, b in zip(before, after, strict=True) if a != b]
    assert len(differing) == 1
    assert "A = 221" in differing[0][1]


def test_a_value_that_is_not_allowed_leaves_the_file_as_it_was(tmp_path: Path) -> None:
    path = tmp_path / "head.toml"
    path.write_text(simulated_toml())
    with pytest.raises(ConfigError, match="K = 256"):
        write_keys(path, {"axes.tilt.filters.position.K": 256})
    with pytest.raises(ConfigError, match="no such key"):
        write_keys(path, {"axes.tilt.filters.position.Q": 3})
    assert path.read_text() == simulated_toml()
