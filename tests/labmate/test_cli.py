"""labmate-drive in this process, on the emulated base in virtual time: results, one-line errors, exit codes."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from labmate.cli import main

Result = tuple[int, str, str]
Run = Callable[..., Result]


@pytest.fixture
def run(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str], tmp_path: Path) -> Run:
    monkeypatch.chdir(tmp_path)

    def call(*arguments: str) -> Result:
        monkeypatch.setattr(sys, "argv", ["labmate-drive", *arguments])
        with pytest.raises(SystemExit) as ended:
            main()
        shown = capsys.readouterr()
        return int(ended.value.code or 0), shown.out, shown.err

    return call


def document(result: Result) -> dict[str, Any]:
    code, out, _ = result
    assert code == 0
    found: dict[str, Any] = json.loads(out)
    return found


def test_go_and_turn_report_what_ended_them(run: Run) -> None:
    assert run("--sim", "go", "0.5") == (0, "GO 0.500 m: reached 0.500 m\n", "")
    gone = document(run("--sim", "--json", "turn", "-90"))
    assert gone["ending"] == "reached"
    # The tolerance.
    assert gone["travelled_deg"] == pytest.approx(-90.0, abs=0.1)


def test_drive_goes_for_as_long_as_it_was_told_and_stops(run: Run) -> None:
    found = document(run("--sim", "drive", "0.1", "--for", "3", "--json"))
    assert found["mode"] == "idle"
    assert found["moving"] is False
    # 3 s at 0.1 m/s; the ramps up and down make up for each other.
    assert found["pose"]["x_m"] == pytest.approx(0.3, abs=0.015)


def test_status_pose_stop_clear_and_estop_answer(run: Run) -> None:
    status = document(run("--sim", "--json", "status"))
    assert (status["mode"], status["wheel_base_mm"], status["counts_per_metre"]) == ("idle", 340.0, 50000)
    assert document(run("--sim", "--json", "pose", "--set", "1", "2", "-30"))["pose"]["heading_deg"] == -30.0
    assert document(run("--sim", "--json", "stop"))["moving"] is False
    assert document(run("--sim", "--json", "estop"))["emergency_stop"] is True
    assert document(run("--sim", "--json", "clear"))["emergency_stop"] is False


def test_monitor_collects_its_snapshots(run: Run) -> None:
    found = document(run("--sim", "--json", "monitor", "--for", "1", "--rate", "10"))["snapshots"]
    assert [snapshot["t"] for snapshot in found] == pytest.approx(
        [n / 10 for n in range(len(found))], abs=0.02
    )
    assert 10 <= len(found) <= 12


def test_square_leaves_table_picture_record_and_calibration(run: Run, tmp_path: Path) -> None:
    code, out, told = run("--sim", "square", "--side", "0.5")
    assert code == 0
    assert "closing mm" in out
    assert "leg 8 of 8" in told
    files = {path.name for path in (tmp_path / "labmate-square").iterdir()}
    assert files == {"square.json", "square.png", "summary.json", "labmate-calibration.toml"}
    assert (tmp_path / "labmate-square/square.png").read_bytes().startswith(b"\x89PNG")
    calibrated = document(
        run("--sim", "--json", "status", "--calibration", "labmate-square/labmate-calibration.toml")
    )
    # A small square tells less; the true base is 337.2 mm.
    assert calibrated["odometry_wheel_base_mm"] == pytest.approx(337.2, abs=0.3)


def test_calibrate_takes_what_the_operator_measured(run: Run, tmp_path: Path) -> None:
    run("--sim", "square")
    # The true ends of the emulated squares, read off to a millimetre.
    found = document(
        run("--json", "calibrate", "--measured", "ccw=225mm,-204mm", "--measured", "cw=-1.2cm,-0.012m")
    )
    assert found["wheel_base_mm"] == pytest.approx(337.2, abs=0.3)
    assert found["wheel_ratio"] == pytest.approx(1.00121, abs=1e-4)
    assert "UMBmark from 2 measured squares" in (tmp_path / "labmate-calibration.toml").read_text()
    code, _, told = run("calibrate", "--measured", "ccw=225m,-204m", "--measured", "cw=-12m,-12m")
    assert code == 2
    assert "check their unit" in told
    code, _, told = run("calibrate", "--measured", "ccw=225mm,-204mm")
    assert code == 2
    assert "1 recorded cw runs, but 0 measured" in told


def test_calibrate_in_the_simulation_measures_itself(run: Run, tmp_path: Path) -> None:
    found = document(run("--sim", "--json", "calibrate", "--out", "found.toml"))
    assert (tmp_path / "found.toml").exists()
    assert abs(found["calibration_error"]["wheel_base_mm"]) < 0.3


def test_init_leaves_the_hazardous_keys_empty_and_the_simulations_filled(run: Run, tmp_path: Path) -> None:
    assert run("init")[0] == 0
    code, _, told = run("--sim", "--config", "labmate.toml", "go", "1")
    assert (code, told.count("\n")) == (3, 1)
    assert "limits.speed_m_s = '': has to be filled in" in told
    assert run("init")[0] == 2
    assert run("--sim", "init", "--force", "labmate.toml")[0] == 0
    assert run("--sim", "--config", "labmate.toml", "go", "0.1")[0] == 0


CALIBRATION = "[calibration]\nwheel_base_mm = 0.3372\nwheel_ratio = 1.0\nwheel_base_deviation_mm = 0\nwheel_ratio_deviation = 0\n[nominal]\nwheel_base_mm = 340.0\ncounts_per_metre = 50000\n"  # noqa: E501


@pytest.mark.parametrize(
    ("arguments", "code", "told"),
    [
        (["go", "1"], 2, "no base named: give --port"),
        (["--port", "/dev/no-such-port", "status"], 4, "no such port"),
        (["--port", "/dev/null", "status"], 4, "not a serial port"),
        (["--sim", "--port", "/dev/ttyUSB0", "status"], 2, "leave --port out"),
        (["--sim", "go", "nan"], 2, "needs a finite number"),
        (["--sim", "go", "far"], 2, "Invalid value for 'distance'"),
        (["--sim", "go", "1e9"], 2, "distance 1e+09 is outside"),
        (["--sim", "turn"], 2, "Missing argument 'angle'"),
        (["--sim", "drive", "0.31", "--for", "1"], 2, "speed 0.31 m/s is over the limit of 0.3 m/s"),
        (["--sim", "drive", "0.1", "15.5", "--for", "1"], 2, "turn rate 15.5°/s is over the limit of 15°/s"),
        (["--sim", "drive", "0.1"], 2, "Missing option '--for'"),
        (["--sim", "monitor", "--rate", "99"], 2, "Invalid value for '--rate'"),
        (["--sim", "--config", "none.toml", "go", "1"], 3, "none.toml: cannot be read"),
        (
            ["--sim", "--calibration", "wrong.toml", "go", "1"],
            3,
            "0.3372 looks like metres, the key is in millimetres",
        ),
        (["--sim", "--trace", "no/such/trace", "go", "1"], 4, "no/such/trace: No such file"),
        (["--sim", "square", "--direction", "ccw"], 2, "leave --direction out"),
        (["--port", "/dev/null", "square"], 2, "one way at a time"),
        (["--port", "/dev/null", "square", "--direction", "up"], 2, "--direction is ccw or cw, not up"),
        (["--sim", "square", "--side", "99"], 2, "Invalid value for '--side'"),
        (["--sim", "square", "--side", "0.1", "--out", "/dev/null"], 3, "cannot be written"),
        (["calibrate"], 2, "nothing measured"),
        (["calibrate", "--measured", "ccw=1,2"], 2, "'1' is no length with its unit"),
        (["calibrate", "--measured", "left"], 2, "it takes ccw=X,Y or cw=X,Y"),
        (["calibrate", "--measured", "cw=1mm,2mm"], 3, "labmate-square/square.json: cannot be read"),
        (["calibrate", "--record", "wrong.toml", "--measured", "cw=1mm,2mm"], 3, "is no record of"),
        (["--sim", "teleop"], 2, "needs a terminal"),
        (["fly"], 2, "No such command 'fly'"),
        (["--sim", "--fast", "go", "1"], 2, "No such option"),
    ],
)
def test_a_mistake_is_one_clear_line_and_a_documented_exit_code(
    run: Run, tmp_path: Path, arguments: list[str], code: int, told: str
) -> None:
    (tmp_path / "wrong.toml").write_text(CALIBRATION)
    found, out, err = run(*arguments)
    errors = [line for line in err.splitlines() if line.startswith("labmate-drive: ")]
    assert (found, out) == (code, "")
    assert len(errors) == 1
    assert told in errors[0]
    assert "Traceback" not in err


def test_what_the_parser_refuses_is_a_json_document_too(run: Run) -> None:
    code, out, err = run("--json", "nonsense")
    message = "No such command 'nonsense'; see labmate-drive --help"
    assert (code, err) == (2, f"labmate-drive: {message}\n")
    assert json.loads(out) == {"error": message, "exit_code": 2}


def test_an_error_is_a_json_document_too(run: Run) -> None:
    code, out, err = run("--sim", "--json", "drive", "9", "--for", "1")
    assert code == 2
    assert json.loads(out) == {"error": "speed 9 m/s is over the limit of 0.3 m/s", "exit_code": 2}
    assert err == "labmate-drive: speed 9 m/s is over the limit of 0.3 m/s\n"


@pytest.mark.parametrize(
    "arguments", [["--sim", "--json", "go", "1"], ["--sim", "--json", "square", "--side", "0.2"]]
)
def test_one_seed_gives_one_output(run: Run, tmp_path: Path, arguments: list[str]) -> None:
    first = run(*arguments, "--seed", "4", "--trace", "one.trace")
    second = run(*arguments, "--seed", "4", "--trace", "two.trace")
    assert first == second
    assert (tmp_path / "one.trace").read_bytes() == (tmp_path / "two.trace").read_bytes()


def test_the_options_of_every_command_may_follow_it(run: Run) -> None:
    before = run("--sim", "--seed", "3", "--json", "go", "-0.2")
    assert before == run("go", "-0.2", "--sim", "--seed=3", "--json")
    assert before[0] == 0


def test_help_imports_nothing_heavy() -> None:
    seen = subprocess.run(
        [sys.executable, "-X", "importtime", "-m", "labmate.cli", "--help"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    names = {line.rpartition("|")[2].strip() for line in seen.stderr.splitlines()}
    assert seen.returncode == 0
    assert "labmate.cli.options" in names
    assert not names & {"numpy", "msgspec", "matplotlib", "serial", "tomlkit"}
