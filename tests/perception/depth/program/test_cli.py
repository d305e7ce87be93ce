"""depth-from-motion from files to files: what it writes, reports and leaves alone."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.depth.program.cli import main

FOCAL, DEPTH, STEP = 100.0, 2.0, 0.1
DATA = Path(__file__).parents[5] / "shared" / "data"


def _steps(count: int, step: str = f"{STEP},0,0,0,0,0") -> str:
    return "tx,ty,tz,wx,wy,wz\n" + f"{step}\n" * count


@pytest.fixture
def plane(tmp_path: Path) -> Path:
    """A textured wall 2 m away, seen from three places 0.1 m apart: 5 px a step, exactly."""
    folder = tmp_path / "views"
    folder.mkdir()
    texture = cv2.GaussianBlur(np.random.default_rng(1).uniform(0, 255, (48, 74)), (0, 0), 1.0)
    texture = cv2.normalize(texture, None, 20, 235, cv2.NORM_MINMAX).astype(np.uint8)
    for index in range(3):
        shift = round(index * FOCAL * STEP / DEPTH)
        cv2.imwrite(str(folder / f"{index}.png"), cv2.merge([texture[:, shift : shift + 64]] * 3))
    (folder / "camera.toml").write_text(f"fx = {FOCAL}\nfy = {FOCAL}\ncx = 31.5\ncy = 23.5\n")
    (folder / "motion.csv").write_text(_steps(2))
    return folder


def _run(monkeypatch: pytest.MonkeyPatch, *arguments: str | Path) -> int:
    monkeypatch.setattr(sys, "argv", ["depth-from-motion", *map(str, arguments)])
    # main() takes SIGTERM; the test's process keeps what it had.
    monkeypatch.setattr("signal.signal", lambda number, handler: None)
    with pytest.raises(SystemExit) as ended:
        main()
    return int(ended.value.code or 0)


def _refused(capsys: pytest.CaptureFixture[str]) -> str:
    lines = [line for line in capsys.readouterr().err.splitlines() if line.startswith("depth-from-motion: ")]
    assert len(lines) == 1
    return lines[0]


def test_a_wall_comes_out_where_it_stands(
    plane: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    out = tmp_path / "out"
    assert _run(monkeypatch, plane, "--out", out) == 0
    names = {f"{index}-{kind}" for index in (1, 2) for kind in ("depth.npy", "std.npy", "depth.png")}
    assert {path.name for path in out.iterdir()} == names | {"cloud.ply", "table.csv"}
    # Two per cent: the bound for noisy images of issue "rendered planes"; here noise is rounding only.
    assert float(np.median(np.load(out / "2-depth.npy"))) == pytest.approx(DEPTH, rel=0.02)
    assert float(np.median(np.load(out / "2-std.npy"))) < 0.02 * DEPTH
    assert "2.png" in capsys.readouterr().out


def test_json_is_one_document_with_the_accuracy(
    plane: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    np.save(tmp_path / "truth.npy", np.full((48, 64), DEPTH, np.float32))
    arguments = ("--reference", tmp_path / "truth.npy", "--reference-frame", "1", "--json")
    assert _run(monkeypatch, plane, "--out", tmp_path / "out", *arguments) == 0
    document = json.loads(capsys.readouterr().out)
    assert [row["picture"] for row in document["pictures"]] == ["1.png", "2.png"]
    # No baseline was given, so pixels of disparity are unknown: null, not zero.
    assert document["pictures"][-1]["accuracy"]["bad_1"] is None
    assert document["pictures"][-1]["accuracy"]["median_relative"] < 0.02


def _replace(plane: Path, index: int, change: str) -> None:
    path = plane / f"{index}.png"
    image = cv2.imread(str(path))
    if change == "grey":
        cv2.imwrite(str(path), image[..., 0])
    elif change == "size":
        cv2.imwrite(str(path), image[:40])
    else:
        path.write_bytes(path.read_bytes()[:40])


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("grey", r"2.png: a grey image after a colour one"),
        ("size", r"2.png: an image of 64×40 after one of 64×48"),
        ("torn", r"2.png: cannot be read as an image"),
    ],
)
def test_a_bad_last_image_is_one_line_and_leaves_no_output(
    plane: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    change: str,
    message: str,
) -> None:
    _replace(plane, 2, change)
    assert _run(monkeypatch, plane, "--out", tmp_path / "out") == 2
    assert message in _refused(capsys)
    assert {path.name for path in tmp_path.iterdir()} == {"views"}


@pytest.mark.parametrize(
    ("steps", "message"),
    [
        (_steps(1), "1 rows for 3 images; 2 are needed"),
        (_steps(2, "0,0,0,0,0,0"), "the camera did not move: no depth can follow"),
        (_steps(2, "0,0,0,0,0.02,0"), "the camera only turned, by 1.15°: no depth can follow"),
        # Millimetres for metres, and kilometres for metres.
        (_steps(2, "100,0,0,0,0,0"), "is the translation in metres?"),
        (_steps(2, "0.0001,0,0,0,0,0"), "is the translation in metres?"),
        (_steps(2, "0.1,0,0,0,90,0"), "are the angles in radians?"),
    ],
)
def test_a_motion_from_which_no_depth_can_follow_is_said_and_none_is_invented(
    plane: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    steps: str,
    message: str,
) -> None:
    (plane / "motion.csv").write_text(steps)
    assert _run(monkeypatch, plane, "--out", tmp_path / "out") == 2
    assert message in _refused(capsys)
    assert not (tmp_path / "out").exists()


def test_a_right_motion_gets_no_warning(
    plane: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    assert _run(monkeypatch, plane, "--out", tmp_path / "out") == 0
    assert "implausible" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "code", "message"),
    [
        (["nowhere", "--out", "o"], 2, "neither a folder of images"),
        (["."], 2, "--out"),
        ([".", "--out", "o", "--bogus"], 2, "--bogus"),
        ([".", "--out", "o", "--near", "close"], 2, "--near"),
        (["views", "--out", "o", "--order", "1,two"], 2, "--order"),
        (["views", "--out", "o", "--order", "1,9"], 3, "image 9: there are 1 to 3"),
        (["views", "--out", "o", "--start-depth", "0"], 2, "above 0"),
        (["views", "--out", "o", "--reference-scale", "nan"], 2, "above 0"),
        (["views", "--out", "o", "--preset", "best"], 3, "no preset 'best'; there is default, thesis"),
        (["views", "--out", "o", "--near", "9", "--far", "3"], 3, "0 < near < far"),
        (["views", "--out", "o", "--camera", "none.toml"], 3, "none.toml: cannot be read"),
        (["views", "--out", "o", "--reference", "none.npy"], 3, "none.npy: cannot be read"),
        (["views", "--out", "views/0.png"], 3, "is no folder"),
        (["views", "--out", "views/0.png/o"], 3, "cannot be written"),
    ],
)
def test_every_wrong_argument_is_one_line(
    plane: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    arguments: list[str],
    code: int,
    message: str,
) -> None:
    monkeypatch.chdir(tmp_path)
    assert _run(monkeypatch, *arguments) == code
    assert message in _refused(capsys)
    assert {path.name for path in tmp_path.iterdir()} == {"views"}


def test_an_error_is_a_document_too_when_json_is_asked_for(
    plane: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    (plane / "motion.csv").unlink()
    assert _run(monkeypatch, plane, "--out", tmp_path / "out", "--json") == 2
    document = json.loads(capsys.readouterr().out)
    assert document["exit_code"] == 2
    assert "no motion given" in document["error"]


@pytest.mark.skipif(not Path("/dev/full").exists(), reason="/dev/full is Linux's")
def test_output_that_nobody_can_take_ends_without_a_traceback(plane: Path, tmp_path: Path) -> None:
    with Path("/dev/full").open("w") as full:
        ended = subprocess.run(
            [sys.executable, "-m", "perception.depth.program.cli", str(plane), "--out", str(tmp_path / "out"),
             "--json"],
            stdout=full, stderr=subprocess.PIPE, text=True, timeout=120, check=False,
        )  # fmt: skip
    assert "Traceback" not in ended.stderr
    assert ended.returncode == 3


def test_help_loads_nothing_heavy() -> None:
    probe = (
        "import sys\n"
        "from perception.depth.program.cli import main\n"
        "sys.argv = ['depth-from-motion', '--help']\n"
        "try:\n    main()\nexcept SystemExit:\n    pass\n"
        "print('loaded', sorted({'numpy', 'cv2', 'matplotlib', 'msgspec'} & set(sys.modules)))\n"
    )
    run = [sys.executable, "-c", probe]
    ended = subprocess.run(run, capture_output=True, text=True, timeout=120, check=True, env={**os.environ})
    assert ended.stdout.splitlines()[-1] == "loaded []"
    assert "--reference-frame" in ended.stdout


@pytest.mark.skipif(not DATA.is_dir(), reason="the real images of ../shared/data are not here")
def test_tsukuba_in_the_order_1_2_5_4_3(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    views = DATA / "stereo_tsukuba"
    (tmp_path / "camera.toml").write_text("fx = 615\nfy = 615\ncx = 191.5\ncy = 143.5\n")
    (tmp_path / "motion.csv").write_text(_steps(4, "0.1,0,0,0,0,0"))
    arguments = ["--camera", tmp_path / "camera.toml", "--motion", tmp_path / "motion.csv", "--near", "3"]
    arguments += ["--reference", views / "truedisp.row3.col3.pgm", "--reference-scale", "16", "--json"]
    arguments += ["--reference-baseline", "0.1", "--order", "1,2,5,4,3", "--out", tmp_path / "out"]
    assert _run(monkeypatch, views / "scene1.row3.col*.ppm", *arguments) == 0
    rows = json.loads(capsys.readouterr().out)["pictures"]
    last = rows[-1]["accuracy"]
    # A smoke test: what a scene of 5 to 14 px of disparity must give when units, order and signs are right.
    assert not any(row["remark"] for row in rows)
    assert last["density"] > 0.95
    assert last["bad_2"] < 0.15


@pytest.mark.skipif(not DATA.is_dir(), reason="the real images of ../shared/data are not here")
@pytest.mark.parametrize("step", ["0,0.1,0", "0,0,0.1", "-0.1,0,0", "10,0,0", "0.0001,0,0"])
def test_tsukuba_with_a_wrong_axis_sign_or_unit_gets_a_warning(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], step: str
) -> None:
    (tmp_path / "camera.toml").write_text("fx = 615\nfy = 615\ncx = 191.5\ncy = 143.5\n")
    (tmp_path / "motion.csv").write_text(_steps(4, f"{step},0,0,0"))
    arguments = ["--camera", tmp_path / "camera.toml", "--motion", tmp_path / "motion.csv", "--order", "1,2"]
    assert (
        _run(
            monkeypatch, DATA / "stereo_tsukuba" / "scene1.row3.col*.ppm", *arguments, "--out", tmp_path / "o"
        )
        == 0
    )
    assert "implausible disparities" in " ".join(capsys.readouterr().err.split())


@pytest.mark.skipif(not DATA.is_dir(), reason="the real images of ../shared/data are not here")
def test_tum_with_its_own_poses_and_depth(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    desk = DATA / "tum_fr1desk9"
    (tmp_path / "camera.toml").write_text("fx = 517.3\nfy = 516.5\ncx = 318.6\ncy = 255.3\n")
    arguments = [
        "--camera",
        tmp_path / "camera.toml",
        "--motion",
        desk / "groundtruth.txt",
        "--order",
        "1,5,9",
    ]
    arguments += [
        "--reference",
        sorted((desk / "depth").iterdir())[-1],
        "--reference-scale",
        "5000",
        "--json",
    ]
    assert _run(monkeypatch, desk / "rgb", *arguments, "--out", tmp_path / "out") == 0
    last = json.loads(capsys.readouterr().out)["pictures"][-1]["accuracy"]
    # Three frames of nine: a smoke test of poses and units, which any error of either breaks wholly.
    assert last["median_relative"] < 0.25
