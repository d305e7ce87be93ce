"""design, identify, tune and saccade from the command line: what they say, write and refuse."""

import re
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Ctl = Callable[..., Any]


def test_design_regenerates_the_tables_and_says_which_bytes_realise_the_filters(ctl: Ctl) -> None:
    ended = ctl("--json", "design")
    assert ended.code == 0
    vergence, pan = ended.json["vergence"], ended.json["pan"]
    assert vergence["plant"]["time_constant_s"] == pytest.approx(16.020856e-3, rel=1e-6)  # equations page 1.2
    assert vergence["position"]["gain"] == pytest.approx(1.14059, abs=5e-6)
    assert vergence["position"]["registers"] == {"A": 225, "B": 0, "K": 5, "T": 255}
    assert round(vergence["velocity"]["accuracy_min"], 2) == 3.56
    assert "cannot both be met" in pan["velocity"]["statement"]
    # Equations page 1.4: 3.5 is printed where (6.22) gives 3.56. No other number of the table differs.
    assert vergence["velocity"]["misprints"] == ["the thesis prints 3.5 for (ii); its own plant gives 3.56"]
    assert pan["velocity"]["misprints"] == ended.json["tilt"]["velocity"]["misprints"] == []
    text = ctl("design").out
    assert "bytes A = 197, B = 0, K = 7, T = 255" in text
    for bound in ("6.19", "3.56", "2.90", "6.40", "4.33", "2.96", "8.71", "10.19", "3.79"):
        assert bound in text


def test_design_searches_the_sample_period_too(ctl: Ctl) -> None:
    tried = ctl("--json", "design", "pan", "--timers", "170,255").json["bytes"]
    assert {row["bytes"]: row["T"] for row in tried} == {"thesis": 255, "best T": 170, "T = 255": 255}
    refused = ctl("design", "pan", "--timers", "170,3")
    assert (refused.code, "whole numbers from 7 to 255" in refused.err) == (2, True)


def test_design_draws_the_three_figures(ctl: Ctl, tmp_path: Path) -> None:
    ended = ctl("--json", "design", "vergence", "--figures", str(tmp_path / "f"))
    assert ended.code == 0
    names = {Path(p).name for p in ended.json["figures"]}
    assert names == {f"figure_6_{n}_vergence.png" for n in (5, 6, 7)}
    for path in ended.json["figures"]:
        assert Path(path).read_bytes().startswith(b"\x89PNG")


def test_design_takes_constants_in_place_of_the_thesis_ones(ctl: Ctl) -> None:
    usual = ctl("--json", "design", "tilt").json["tilt"]
    heavy = ctl("--json", "design", "tilt", "--inertia", str(2 * usual["constants"]["inertia"])).json["tilt"]
    # (6.5): T_M is proportional to J; C does not depend on it.
    assert heavy["plant"]["time_constant_s"] == pytest.approx(2 * usual["plant"]["time_constant_s"])
    assert heavy["plant"]["velocity_gain_counts_s"] == pytest.approx(usual["plant"]["velocity_gain_counts_s"])
    geared = ctl("--json", "design", "tilt", "--lines", "500", "--gear", "100").json["tilt"]
    assert geared["counts_per_degree"] == pytest.approx(200_000 / 360)  # 4 N G counts a turn


@pytest.mark.parametrize(
    ("arguments", "complaint"),
    [
        (
            ["design", "pan", "--speed", "270"],
            r"270\.0°/s is over the 197\.2°/s .* no sample period allows it",
        ),
        (["design", "tilt", "--speed", "180"], r"204\.8 counts a sample.*127.*1\.264 ms \(T = 157\)"),
        (["design", "tilt", "--speed", "0"], r"needs a speed above 0"),
        (
            ["design", "tilt", "--acceleration", "0"],
            r"acceleration of 0°/s² moves nothing; it must be above 0",
        ),
        (["design", "pan", "--bytes", "0,0,60,255"], r"is unstable at 2\.048 ms: a pole of magnitude 1\.49"),
        (["design", "pan", "--bytes", "0,0,60"], r"'0,0,60' is not four bytes A,B,K,T"),
        (["design", "pan", "--bytes", "0,0,300,255"], r"K = 300 is outside 0\.\.255"),
        (["design", "--timer", "7"], r"the double pole needs K = 1089\.\d.*63\.75"),
        (["design", "neck"], r"no kind of joint 'neck'; there are vergence, tilt, pan"),
        (["design", "pan", "--lines", "500"], r"--lines and --gear belong together"),
        (["design", "pan", "--inertia", "-1"], r"inertia = -1 must be above 0"),
        (["design", "pan", "--inertia", "nan"], r"inertia = nan must be above 0"),
        (["--sim", "saccade"], r"nowhere to look: give --pan, --tilt, --version or --vergence"),
        (
            ["--sim", "saccade", "--pan", "200"],
            r"pan: 200\.00° is outside the soft limits -93\.00\.\.93\.00°",
        ),
        (["--sim", "saccade", "--vergence", "-3"], r"vergence of -3° is below 0"),
        (["--sim", "identify", "neck"], r"no joint 'neck'; the head has pan, tilt"),
        (
            ["--sim", "identify", "tilt", "--excursion", "25"],
            r"tilt: is at .* the excitation needs 50\.00° each way",
        ),
        (["--sim", "identify", "tilt", "--largest", "400"], r"400 DAC counts is not in 4\.\.127"),
        (["--sim", "tune", "pan", "--bytes", "0,0,60,255"], r"is unstable"),
    ],
    ids=lambda value: " ".join(value) if isinstance(value, list) else None,
)
def test_what_cannot_be_done_is_refused_in_one_line(ctl: Ctl, arguments: list[str], complaint: str) -> None:
    ended = ctl(*arguments)
    assert re.search(complaint, ended.complaint), ended.complaint
    assert ended.code == 2
    assert ended.out == ""


def test_saccade_takes_all_joints_there_together(ctl: Ctl) -> None:
    ended = ctl(
        "--sim", "--json", "saccade", "--pan", "20", "--tilt", "-5", "--version", "10", "--vergence", "4"
    )
    assert ended.code == 0
    rows = {row["axis"]: row for row in ended.json["saccade"]}
    targets = {name: row["target_deg"] for name, row in rows.items()}
    # version = (l + r)/2, vergence = r − l
    assert targets == {"pan": 20.0, "tilt": -5.0, "left_vergence": 8.0, "right_vergence": 12.0}
    assert len({row["profile_ms"] for row in rows.values()}) == 1
    assert not any(row["ends_early"] for row in rows.values())
    assert ended.json["end_skew_ms"] <= 2 * 2.048
    for row in rows.values():
        assert row["angle_deg"] == pytest.approx(
            row["target_deg"], abs=0.03
        )  # the dead band, 7 counts at most


def test_identify_says_the_plant_with_its_uncertainty_and_saves_it(ctl: Ctl, tmp_path: Path) -> None:
    ended = ctl("--sim", "identify", "tilt", "--save", str(tmp_path / "tilt.json"))
    assert ended.code == 0
    assert re.search(r"T_M = 13\.[56]\d+ ± 0\.0\d+ ms, C = 101[34]\.\d+ ±", ended.out)
    assert '"friction_dac"' in (tmp_path / "tilt.json").read_text()


def test_tune_writes_the_searched_bytes_to_board_and_configuration_only_when_told(
    ctl: Ctl, tmp_path: Path
) -> None:
    ctl("--sim", "init", "head.toml")
    file = tmp_path / "head.toml"
    for axis in ("tilt", "left_vergence", "right_vergence", "pan"):
        assert ctl("--sim", "--config", "head.toml", "check", axis).code == 0
    before = file.read_text()
    looked = ctl("--sim", "--config", "head.toml", "--json", "tune", "pan", "--bytes", "170,144,25,255")
    assert looked.code == 0, looked.err
    assert file.read_text() == before
    written = ctl("--sim", "--config", "head.toml", "--json", "tune", "pan", "--write")
    assert written.code == 0, written.err
    assert written.json["written_to_file"] == "head.toml"
    chosen = written.json["tuned"][0]["bytes"]
    assert chosen["settling_1000_ms"] < written.json["tuned"][0]["thesis_bytes"]["settling_1000_ms"]
    filters = tomllib.loads(file.read_text())["axes"]["pan"]["filters"]
    assert filters["position"] == filters["integral_velocity"] == {k: chosen[k] for k in "ABKT"}
    assert filters["proportional_velocity"]["K"] == 15  # the byte nearest to 3.79, table 6.2 (iii)
    assert file.read_text().count("#") == before.count("#")  # comments kept
    changed = ctl("--sim", "--config", "head.toml", "saccade", "--pan", "5")
    assert "not checked since the configuration changed" in changed.complaint


def test_tune_refuses_a_timer_that_other_joints_of_the_board_do_not_have(ctl: Ctl) -> None:
    ctl("--sim", "init", "head.toml")
    for axis in ("tilt", "left_vergence", "right_vergence", "pan"):
        ctl("--sim", "--config", "head.toml", "check", axis)
    ended = ctl("--sim", "--config", "head.toml", "tune", "tilt", "--bytes", "211,40,39,124", "--write")
    assert ended.code == 3
    assert "start together only with equal timers" in ended.complaint
