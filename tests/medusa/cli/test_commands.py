"""Every command on the simulated head: what it says, and that one seed says it twice alike."""

import json
import os
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

Ctl = Callable[..., Any]
JOINTS = {"pan", "tilt", "left_vergence", "right_vergence"}


def test_info_names_boards_and_amplifiers(ctl: Ctl) -> None:
    document = ctl("--sim", "--json", "info").json
    assert [board["board"] for board in document["boards"]] == ["01H", "02H"]
    assert {amplifier["axis"]: amplifier["amplifier"] for amplifier in document["amplifiers"]} == {
        "left_vergence": "01H",
        "right_vergence": "02H",
        "tilt": "03H",
        "pan": "04H",
    }


def test_status_shows_a_head_just_switched_on(ctl: Ctl) -> None:
    document = ctl("--sim", "--json", "status").json
    assert {joint["axis"] for joint in document["joints"]} == JOINTS
    # Unknown is not zero: before homing there is no angle.
    assert all(joint["angle_deg"] is None and not joint["homed"] for joint in document["joints"])
    assert all(bridge["bridge"] == "off" for bridge in document["amplifiers"])


def test_amps_tells_the_bus_voltage(ctl: Ctl) -> None:
    assert {row["bus_v"] for row in ctl("--sim", "--json", "amps").json["amplifiers"]} == {48.0}


def test_move_homes_a_simulated_head_first_and_says_so(ctl: Ctl) -> None:
    ended = ctl("--sim", "--json", "move", "--pan", "30", "--tilt", "-5")
    assert "homing it first" in ended.err
    moved = {row["axis"]: row for row in ended.json["moved"]}
    assert set(moved) == {"pan", "tilt"}
    for name, target in (("pan", 30.0), ("tilt", -5.0)):
        # The dead band of thesis chapter 6 at rest is a few counts; a count of pan is 0.0036°.
        assert moved[name]["angle_deg"] == pytest.approx(target, abs=0.03)
        assert moved[name]["settled"]


def test_home_finds_the_joints_named(ctl: Ctl) -> None:
    homed = ctl("--sim", "--json", "home", "tilt").json["homed"]
    assert [row["axis"] for row in homed] == ["tilt"]


def test_jog_turns_and_stops(ctl: Ctl) -> None:
    document = ctl("--sim", "--json", "jog", "pan", "-10", "--seconds", "2").json
    # Two seconds at 10°/s, and the ramps.
    assert document["angle_deg"] == pytest.approx(-20.0, abs=2.0)


@pytest.mark.parametrize(
    ("command", "document"), [("stop", {"confirmed": True}), ("estop", {"confirmed": True})]
)
def test_stops_are_confirmed(ctl: Ctl, command: str, document: dict[str, bool]) -> None:
    assert ctl("--sim", "--json", command).json == document


def test_clear_tells_what_is_still_latched(ctl: Ctl) -> None:
    assert ctl("--sim", "--json", "clear").json == {"still_latched": {}}


def test_park_ends_at_the_park_angles(ctl: Ctl) -> None:
    parked = ctl("--sim", "--json", "park").json["parked_deg"]
    assert set(parked) == JOINTS
    assert all(abs(angle) < 0.03 for angle in parked.values())


def test_check_shows_that_counts_follow_with_the_configured_sign(ctl: Ctl) -> None:
    # The right vergence is mirrored: positive joint angles are falling counts.
    document = ctl("--sim", "--json", "check", "right_vergence").json
    assert document["forward_counts"] < 0 < document["backward_counts"]
    assert document["motor_command_counts"] <= 4


def test_raw_reads_and_writes_registers(ctl: Ctl) -> None:
    assert ctl("--sim", "--json", "raw", "read", "pan", "08").json == {
        "axis": "pan",
        "register": 8,
        "values": [0x80],
    }
    assert ctl("--sim", "--json", "raw", "write", "pan", "22", "40").json["written"] == [0x40]
    assert ctl("--sim", "raw", "read", "pan", "0x20", "3").out.startswith("20H=")


def test_monitor_shows_a_table_and_with_json_its_last_look(ctl: Ctl) -> None:
    shown = ctl("--sim", "monitor", "--seconds", "1")
    assert "right_vergence" in shown.out
    assert {
        joint["axis"] for joint in ctl("--sim", "--json", "monitor", "--seconds", "1").json["joints"]
    } == JOINTS


def test_options_may_stand_before_or_after_the_command(ctl: Ctl) -> None:
    assert (
        ctl("status", "--sim", "--json", "--seed=3").json
        == ctl("--sim", "--seed", "3", "--json", "status").json
    )


def test_the_demo_looks_around_parks_and_leaves_table_and_picture(ctl: Ctl, tmp_path: Path) -> None:
    ended = ctl("--sim", "demo", "--out", "left")
    assert ended.code == 0
    assert "straight ahead" in ended.out
    gazes = json.loads((tmp_path / "left" / "demo.json").read_text())["gazes"]
    assert len(gazes) >= 4
    for gaze in gazes:
        assert gaze["settled"]
        assert all(abs(gaze[f"{joint}_error"]) < 0.03 for joint in JOINTS)
    # The eight bytes with which every PNG begins.
    assert (tmp_path / "left" / "demo.png").read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"


def test_two_runs_with_one_seed_give_identical_traces_and_json(ctl: Ctl, tmp_path: Path) -> None:
    def run(name: str, seed: str, *command: str) -> tuple[str, bytes]:
        ended = ctl("--sim", "--seed", seed, "--json", "--trace", f"{name}.txt", *command)
        assert ended.code == 0
        return ended.out, (tmp_path / f"{name}.txt").read_bytes()

    demo = ("demo", "--no-picture", "--dwell", "0")
    first, second = run("one", "7", *demo), run("two", "7", *demo)
    assert first == second
    assert run("three", "7", "info") != run("four", "8", "info")
    # Both lines are in it, both directions, and what was meant.
    for piece in (
        b" boards > ",
        b" boards < ",
        b" amps > ",
        b" amps < ",
        b"HELLO",
        b"SNAPSHOT",
        b"write 01.00",
    ):
        assert piece in first[1]


def test_the_file_of_init_for_the_simulated_head_is_the_simulated_heads_own(ctl: Ctl) -> None:
    assert ctl("--sim", "init", "head.toml").code == 0
    own = ctl("--sim", "--json", "move", "--pan", "10").json
    # A head described by a file has to be checked before it is homed.
    assert "run check first" in ctl("--sim", "--config", "head.toml", "move", "--pan", "10").complaint
    assert own["moved"][0]["settled"]


@pytest.mark.real_time
@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_the_head_and_the_stop_is_confirmed(number: signal.Signals, tmp_path: Path) -> None:
    trace = tmp_path / "wire.txt"
    program = [sys.executable, "-c", "from medusa.cli import main; main()"]
    jogging = subprocess.Popen(
        [*program, "--sim", "--trace", str(trace), "jog", "pan", "0", "--seconds", "600"],
        stderr=subprocess.PIPE,
        text=True,
    )
    assert jogging.stderr is not None
    try:
        for line in jogging.stderr:
            if "for 600 s" in line:
                break
        os.kill(jogging.pid, number)
        told = jogging.stderr.read()
        assert jogging.wait(timeout=60) == 128 + number
    finally:
        jogging.kill()
        jogging.stderr.close()
    assert told.splitlines()[-1] == f"medusa-ctl: stopped by {number.name}; the head is at rest"
    # After the STOP the boards were asked until the joints stood, and the bridge was inhibited last.
    lines = trace.read_text().splitlines()
    stop = next(i for i, line in reversed(list(enumerate(lines))) if " request " in line and " STOP" in line)
    assert any("SNAPSHOT" in line for line in lines[stop:])
    assert any("amplifier 04H, write 01.00 = 0100" in line for line in lines[stop:])
