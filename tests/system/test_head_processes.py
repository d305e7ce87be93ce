"""medusa-ctl and the emulators as processes of their own: signals, violent ends, and how one goes on after them."""

import json
import os
import pty
import re
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, ExitStack
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from medusa.mc3000.simulated_config import simulated_toml
from sim_devices.control import call

BIN = Path(sys.executable).parent
pytestmark = pytest.mark.real_time


@dataclass
class Bench:
    """A served head and a configuration for it, in a folder of their own."""

    folder: Path
    serving: Callable[[Path, str], AbstractContextManager[Path]]

    def __post_init__(self) -> None:
        self._served = ExitStack()

    def plug(self) -> None:
        """Switch everything on."""
        self._served.enter_context(self.serving(self.folder, "[head.start_deg]\npan = -22.5\n"))

    def unplug(self) -> None:
        """Switch everything off: the ports hang up, the boards forget."""
        self._served.close()

    def run(self, *arguments: str) -> "subprocess.CompletedProcess[str]":
        return subprocess.run(
            [BIN / "medusa-ctl", *arguments], cwd=self.folder, capture_output=True, text=True, timeout=60
        )

    def start_jog(self) -> "subprocess.Popen[str]":
        """A host that jogs pan, slowly and for long; it has begun."""
        jogging = subprocess.Popen(
            [BIN / "medusa-ctl", "jog", "pan", "2", "--seconds", "40"],
            cwd=self.folder,
            stderr=subprocess.PIPE,
            text=True,
        )
        assert jogging.stderr is not None
        assert re.match(r"pan: \+1\.\d+°/s for 40 s", jogging.stderr.readline())
        return jogging

    def pan(self) -> dict[str, Any]:
        pan: dict[str, Any] = call(self.folder / "sim", "inspect")["head"]["joints"]["pan"]
        return pan

    def pan_when(self, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
        deadline = time.monotonic() + 20
        pan = self.pan()
        while not reached(pan) and time.monotonic() < deadline:
            pan = self.pan()
        return pan


@pytest.fixture(scope="module")
def bench(
    tmp_path_factory: pytest.TempPathFactory, serving: Callable[[Path, str], AbstractContextManager[Path]]
) -> Iterator[Bench]:
    """Pan checked and homed by a process that has ended."""
    folder = tmp_path_factory.mktemp("head")
    config = simulated_toml().replace('# boards = "/dev/ttyUSB0"', 'boards = "sim/mc3000"')
    config = config.replace('# amplifiers = "/dev/ttyUSB1"', 'amplifiers = "sim/servo-amps"')
    # A busy machine may keep a host from feeding the boards for longer than the 400 ms that the page suggests.
    config = config.replace("board_watchdog_ms = 400", "board_watchdog_ms = 2500")
    (folder / "medusa.toml").write_text(config)
    bench = Bench(folder, serving)
    bench.plug()
    try:
        for command in ("check", "home"):
            ended = bench.run(command, "pan")
            assert ended.returncode == 0, ended.stderr
        yield bench
    finally:
        bench.unplug()


def complaint(ended: "subprocess.CompletedProcess[str]") -> str:
    """What it said went wrong; above it may be what a busy machine made it repeat."""
    assert "Traceback" not in ended.stderr
    return ended.stderr.splitlines()[-1].removeprefix("medusa-ctl: ")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_stops_a_jog_and_what_it_says_is_true(bench: Bench, number: signal.Signals) -> None:
    jogging = bench.start_jog()
    jogging.send_signal(number)
    _, err = jogging.communicate(timeout=60)
    assert jogging.returncode == 128 + number
    assert err.splitlines()[-1] == f"medusa-ctl: stopped by {number.name}; the head is at rest"
    assert_at_rest(bench.pan())


def assert_at_rest(pan: dict[str, Any]) -> None:
    assert (pan["mode"], pan["motor_command"], pan["bridge"]) == (0, 0, "inhibited")
    assert pan["velocity"] == pytest.approx(0.0, abs=1e-4)


def test_a_closed_terminal_stops_a_jog(bench: Bench) -> None:
    # What a closed ssh does: the terminal hangs up, its processes get SIGHUP, and nothing can be written any more.
    master, slave = pty.openpty()
    jogging = subprocess.Popen(
        [BIN / "medusa-ctl", "--json", "jog", "pan", "2", "--seconds", "40"],
        cwd=bench.folder,
        preexec_fn=partial(os.login_tty, slave),
    )
    os.close(slave)
    # Half of the 2°/s asked for, rad/s.
    moving = bench.pan_when(lambda pan: pan["velocity"] > 0.017)
    os.close(master)
    assert moving["velocity"] > 0.017
    assert jogging.wait(timeout=60) == 128 + signal.SIGHUP
    assert_at_rest(bench.pan())


def test_what_a_killed_host_leaves_is_cleared_and_the_joint_is_still_homed(bench: Bench) -> None:
    jogging = bench.start_jog()
    os.kill(jogging.pid, signal.SIGKILL)
    jogging.communicate()
    # The board's watchdog, then the amplifier's own: a fault, latched.
    assert bench.pan_when(lambda pan: pan["bridge"] == "inhibited")["faults"] == ["COMMUNICATION_ERROR"]
    refused = bench.run("move", "--pan", "0")
    assert refused.returncode == 2
    assert complaint(refused) == "pan: an amplifier fault is latched; clear it first"
    cleared = bench.run("clear")
    assert (cleared.returncode, cleared.stdout) == (0, "nothing is latched\n")
    moved = bench.run("--json", "move", "--pan", "0")
    assert moved.returncode == 0, moved.stderr
    # The dead band of the servo loop: a few counts of 0.0036°.
    assert json.loads(moved.stdout)["moved"][0]["angle_deg"] == pytest.approx(0.0, abs=0.03)


def test_the_head_is_stopped_without_its_amplifiers(bench: Bench) -> None:
    refused = bench.run("--amps", "nowhere", "status")
    assert (refused.returncode, complaint(refused)) == (4, "nowhere: no such port")
    for command, state in (
        ("stop", "every joint is at rest"),
        ("estop", "emergency stop latched, every joint idle"),
    ):
        ended = bench.run("--amps", "nowhere", command)
        assert (ended.returncode, ended.stdout) == (0, f"{state}\n")
    assert bench.run("clear").stdout == "nothing is latched\n"


def test_pulling_everything_ends_a_jog_with_its_name_and_homing_with_it(bench: Bench) -> None:
    jogging = bench.start_jog()
    bench.unplug()
    _, err = jogging.communicate(timeout=60)
    assert jogging.returncode == 6
    assert "Traceback" not in err
    assert "line lost: sim/mc3000: the port has vanished" in err.splitlines()[-1]
    gone = bench.run("status")
    assert (gone.returncode, complaint(gone)) == (4, "sim/mc3000: no such port")
    bench.plug()
    refused = bench.run("move", "--pan", "0")
    assert refused.returncode == 2
    assert complaint(refused) == "pan: not homed; run `medusa-ctl home` first"
    # Checked it still is; whoever comes next finds it homed.
    assert bench.run("home", "pan").returncode == 0
