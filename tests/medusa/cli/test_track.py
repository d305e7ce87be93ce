"""medusa-ctl track and calibrate: what they leave behind, and one clear line for what cannot be done."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from medusa.cli.track_eyes import _capture_settings, _load_geometry
from medusa.errors import CommandError
from perception.camera.intrinsics import load_intrinsics

Ctl = Callable[..., Any]


def test_track_leaves_a_table_a_figure_and_a_video(ctl: Ctl, tmp_path: Path) -> None:
    video = tmp_path / "eyes.avi"
    result = ctl("--sim", "--json", "track", "--seconds", "4", "--out", str(tmp_path), "--video", str(video))
    assert result.code == 0
    document = result.json
    assert document["seen"] == document["pictures"] > 10
    assert document["rms_error_deg"] < 1.0
    assert document["median_vergence_error_deg"] < 0.3
    assert json.loads((tmp_path / "track.json").read_text())["saccades"] == document["saccades"]
    assert cv2.imread(str(tmp_path / "track.png")).std() > 10.0
    capture = cv2.VideoCapture(str(video))
    frames = [frame for got, frame in iter(capture.read, (False, None)) if got]
    assert len(frames) >= 20
    assert frames[0].shape == (346, 646, 3)


def test_track_follows_by_the_thesis_controller_too(ctl: Ctl, tmp_path: Path) -> None:
    result = ctl(
        "--sim",
        "--json",
        "track",
        "--controller",
        "thesis",
        "--coordination",
        "ii",
        "--seconds",
        "6",
        "--out",
        str(tmp_path),
    )
    assert result.code == 0
    assert result.json["rms_error_deg"] < 4.0


def test_track_verges_by_disparity_at_the_fovea(ctl: Ctl, tmp_path: Path) -> None:
    words = ["--target", "texture", "--vergence", "disparity", "--seconds", "6", "--out", str(tmp_path)]
    result = ctl("--sim", "--json", "track", *words)
    assert result.code == 0
    assert result.json["median_vergence_error_deg"] < 0.2


def test_track_shows_real_pictures_on_a_screen(ctl: Ctl, tmp_path: Path) -> None:
    pictures = tmp_path / "pictures"
    pictures.mkdir()
    for k in range(4):
        image = np.full((144, 192), 40, np.uint8)
        cv2.ellipse(image, (90, 90), (14, 11), 10 * k, 0, 360, 250, cv2.FILLED)
        cv2.rectangle(image, (0, 0), (191, 30), 250, cv2.FILLED)  # as bright, larger and no ellipse
        cv2.imwrite(str(pictures / f"{k}.png"), image)
    result = ctl(
        "--sim",
        "--json",
        "track",
        "--screen",
        str(pictures),
        "--coordination",
        "iii",
        "--seconds",
        "5",
        "--out",
        str(tmp_path),
    )
    assert result.code == 0
    document = result.json
    assert document["seen"] > 0.9 * document["pictures"]
    assert document["median_error_deg"] < 1.0


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["--controller", "magic"], "no controller 'magic'"),
        (["--gains", "vii"], "no column of table 6.4 'vii'"),
        (["--coordination", "iv"], "no coordination 'iv'"),
        (["--target", "cat"], "no emulated target 'cat'"),
        (["--vergence", "guess"], "no vergence from 'guess'"),
        (["--left", "0"], "leave --left"),
        (["--screen", "nowhere"], "nowhere"),
        (["--video", "video.gif"], "a video ends in"),
        (["--video", "no/such/folder/video.avi"], "No such file"),
        (["--patch", "nowhere.png"], "nowhere.png"),
    ],
)
def test_what_track_cannot_do_is_one_line(ctl: Ctl, tmp_path: Path, words: list[str], said: str) -> None:
    result = ctl("--sim", "track", "--seconds", "1", "--out", str(tmp_path), *words)
    assert result.code in (2, 4)
    assert said in result.complaint


def test_calibrate_finds_the_emulated_heads_geometry(ctl: Ctl, tmp_path: Path) -> None:
    file = tmp_path / "cameras.toml"
    result = ctl("--sim", "--json", "calibrate", "--head", "--out", str(file))
    assert result.code == 0
    document = result.json
    # The emulated mounts: centres 12 mm before the axes; corners to .1 px of 340 are .02 degrees.
    assert document["head"]["baseline_mm"] == pytest.approx(130.0, abs=2.0)
    assert document["head"]["left_centre_mm"][0] == pytest.approx(12.0, abs=4.0)
    assert document["head"]["residual_deg"] < 0.1
    assert load_intrinsics(file, "left").fx == pytest.approx(343.1, rel=0.02)
    geometry, turns = _load_geometry(file)
    assert geometry.baseline == pytest.approx(0.130, abs=0.002)
    # 0.8 degrees of yaw to the left are -y of the optical axes.
    assert np.degrees(turns[0])[0, 2] == pytest.approx(-0.8, abs=0.2)


def test_calibrate_draws_the_board_to_print(ctl: Ctl, tmp_path: Path) -> None:
    result = ctl("--sim", "calibrate", "--draw", str(tmp_path / "board.png"), "--columns", "5", "--rows", "4")
    assert result.code == 0
    assert cv2.imread(str(tmp_path / "board.png")).shape == (400, 500, 3)


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ([], "use calibrate --head"),
        (["--head", "--marker", "50"], "0.05 m do not fit"),
        (["--head", "--dictionary", "DICT_9"], "DICT_9"),
    ],
)
def test_what_calibrate_cannot_do_is_one_line(ctl: Ctl, tmp_path: Path, words: list[str], said: str) -> None:
    result = ctl("--sim", "calibrate", "--out", str(tmp_path / "c.toml"), *words)
    assert result.code in (2, 4)
    assert said in result.complaint


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("[left]\n", r"\[head\] baseline_m is missing"),
        ("[head]\nbaseline_m = 0.13\nleft_centre_m = [1.0]\n", "left_centre_m must be three"),
    ],
)
def test_a_calibration_without_its_geometry_is_named(tmp_path: Path, text: str, said: str) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text(text)
    with pytest.raises(CommandError, match=said):
        _load_geometry(path)


def test_capture_settings_come_from_the_calibrations_file(tmp_path: Path) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text('[capture]\nwidth = 640\nheight = 480\npixel_format = "GREY"\nexposure = 12.5\n')
    settings = _capture_settings(path, 25.0)
    assert (settings.width, settings.height, settings.rate) == (640, 480, 25.0)
    assert (settings.pixel_format, settings.exposure, settings.gain) == ("GREY", 12.5, None)


@pytest.mark.parametrize(
    ("line", "said"),
    [("widht = 3", "not 'widht'"), ('width = "x"', "wrong kind"), ('pixel_format = "GREYS"', "four letters")],
)
def test_a_mistake_in_the_capture_settings_is_named(tmp_path: Path, line: str, said: str) -> None:
    path = tmp_path / "cameras.toml"
    path.write_text(f"[capture]\n{line}\n")
    with pytest.raises(CommandError, match=said):
        _capture_settings(path, 25.0)
