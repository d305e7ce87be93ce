"""Configuration and calibration files: every mistake in one line with file, key, value and what is allowed."""

from math import degrees
from pathlib import Path

import pytest

from labmate.calibration import Calibration
from labmate.config import read_calibration, read_config, template, write_calibration
from medusa.errors import ConfigError

FILLED = {
    "speed_m_s": 0.3,
    "turn_rate_deg_s": 15.0,
    "acceleration_m_s2": 0.25,
    "turn_acceleration_deg_s2": 30.0,
    "watchdog_ms": 500,
}
CALIBRATION = """
[calibration]
wheel_base_mm = 337.2
wheel_ratio = 1.00121
wheel_base_deviation_mm = 0.05
wheel_ratio_deviation = 1e-5
[nominal]
wheel_base_mm = 340.0
counts_per_metre = 50000
"""


def written(tmp_path: Path, text: str) -> Path:
    path = tmp_path / "base.toml"
    path.write_text(text)
    return path


def test_the_filled_template_is_a_configuration_in_si_units(tmp_path: Path) -> None:
    config = read_config(written(tmp_path, template(FILLED)))
    limits = config.motion_limits
    assert (limits.speed, limits.acceleration) == (0.3, 0.25)
    assert (degrees(limits.turn_rate), degrees(limits.turn_acceleration)) == pytest.approx((15.0, 30.0))
    assert config.safety.watchdog_ms == 500
    assert config.port.address == 0x10


def test_the_template_as_written_by_init_leaves_the_hazardous_keys_to_the_user(tmp_path: Path) -> None:
    with pytest.raises(
        ConfigError, match=r"limits\.speed_m_s = '': has to be filled in: a number from 0\.01 to 1"
    ):
        read_config(written(tmp_path, template()))


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        ("speed_m_s = 0.3", "speed_m_s = 300", "a number from 0.01 to 1; 300 looks like millimetres"),
        ("speed_m_s = 0.3", "speed_m_s = true", "limits.speed_m_s = True: a number"),
        ("speed_m_s = 0.3", "speed_m_s = nan", "limits.speed_m_s = nan"),
        ("watchdog_ms = 500", "watchdog_ms = 0", "safety.watchdog_ms = 0: an integer from 200 to 2000"),
        ("watchdog_ms = 500", "", "safety.watchdog_ms is missing: an integer from 200 to 2000"),
        ("baud = 115200", "baud = 115201", "port.baud = 115201: one of 9600"),
        ("address = 16", "address = 16\nfile = 3", "port.file = 3: no such key is known"),
        ("[limits]", "[limit]", "limit"),
        ("[port]", "file = 'x'\n[port]", "file = 'x': no such key is known"),
        ("[port]", "[port", "is not TOML"),
    ],
)  # fmt: skip
def test_a_mistake_names_file_key_value_and_range(tmp_path: Path, old: str, new: str, told: str) -> None:
    path = written(tmp_path, template(FILLED).replace(old, new))
    with pytest.raises(ConfigError) as caught:
        read_config(path)
    assert told in str(caught.value)
    assert str(caught.value).startswith(str(path))
    assert "\n" not in str(caught.value)


def test_a_missing_file_says_so(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"none\.toml: cannot be read: No such file"):
        read_config(tmp_path / "none.toml")


def test_a_calibration_survives_its_file(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    found = Calibration(0.33720123, 1.00121456, 0.00005, 0.00001)
    write_calibration(path, found, 0.340, 50_000, "UMBmark, 4 m\nmeasured by hand")
    read = read_calibration(path)
    # The file keeps a tenth of a micrometre and 1e-8, a thousandth of what a square can tell.
    assert read.value.wheel_base == pytest.approx(found.wheel_base, abs=1e-7)
    assert read.value.wheel_ratio == pytest.approx(found.wheel_ratio, abs=1e-8)
    assert path.read_text().startswith("# UMBmark, 4 m\n# measured by hand\n")
    read.check_belongs_to(0.340, 50_000)


@pytest.mark.parametrize(
    ("old", "new", "told"),
    [
        (
            "wheel_base_mm = 337.2",
            "wheel_base_mm = 0.3372",
            "0.3372 looks like metres, the key is in millimetres",
        ),
        ("wheel_base_mm = 337.2", "wheel_base_mm = 33.72", "a number from 50 to 2000"),
        ("wheel_base_mm = 337.2", "wheel_base_mm = 132.7", "must lie within 10 % of the nominal 340.0 mm"),
        ("wheel_ratio = 1.00121", "wheel_ratio = 0.121", "a number from 0.9 to 1.1"),
        ("wheel_ratio = 1.00121", "", "calibration.wheel_ratio is missing: a number from 0.9 to 1.1"),
        ("wheel_base_mm = 340.0", "wheel_base_mm = 0.34", "0.34 looks like metres"),
    ],
)
def test_a_calibration_in_wrong_units_is_noticed(tmp_path: Path, old: str, new: str, told: str) -> None:
    with pytest.raises(ConfigError) as caught:
        read_calibration(written(tmp_path, CALIBRATION.replace(old, new)))
    assert told in str(caught.value)


@pytest.mark.parametrize(
    ("base", "counts", "key"), [(0.36, 50_000, "wheel_base_mm"), (0.34, 40_000, "counts")]
)
def test_the_calibration_of_another_base_is_refused(
    tmp_path: Path, base: float, counts: int, key: str
) -> None:
    read = read_calibration(written(tmp_path, CALIBRATION))
    with pytest.raises(ConfigError, match=key):
        read.check_belongs_to(base, counts)


def test_a_calibration_that_cannot_be_written_names_its_file(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    path = tmp_path / "file" / "f.toml"
    with pytest.raises(ConfigError, match=rf"^{path}: cannot be written: Not a directory$"):
        write_calibration(path, Calibration(0.34, 1.0, 0.0, 0.0), 0.34, 50_000, "")
