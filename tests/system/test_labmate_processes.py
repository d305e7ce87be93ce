"""labmate-drive against sim-devices, each a process of its own on the wall clock: killed, interrupted, hung up."""

import os
import pty
import select
import signal
import subprocess
import sys
import termios
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, suppress
from pathlib import Path
from typing import Any

import pytest

from sim_devices.control import call

BIN = Path(sys.executable).parent
WATCHDOG_S, RAMP_S = 0.5, 1.2
SCHEDULING_S = 1.0
"""What a busy machine may delay: a frame under way, or a process between two of its lines."""
PATIENCE_S = 40.0

ended = threading.Event()
"""Never set: its wait lets the other processes run."""


@pytest.fixture
def links(tmp_path: Path, serving: Callable[[Path, str], AbstractContextManager[Path]]) -> Iterator[Path]:
    with serving(tmp_path, "[[base]]\n") as links:
        yield links


@pytest.fixture
def config(tmp_path: Path) -> Path:
    written = subprocess.run(
        [BIN / "labmate-drive", "--sim", "init", tmp_path / "base.toml"], check=False, timeout=60
    )
    assert written.returncode == 0
    return tmp_path / "base.toml"


def state(links: Path) -> dict[str, Any]:
    found: dict[str, Any] = call(links, "inspect")
    return found


def truth(links: Path) -> dict[str, Any]:
    base: dict[str, Any] = state(links)["base"]
    return base


def truth_when(links: Path, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The base as soon as it is as wished; as it is after a generous while."""
    deadline = time.monotonic() + PATIENCE_S
    base = truth(links)
    while not reached(base) and time.monotonic() < deadline:
        ended.wait(0.02)
        base = truth(links)
    return base


def moving(base: dict[str, Any]) -> bool:
    return bool(base["speed"] > 0.05)


def at_rest(base: dict[str, Any]) -> bool:
    return bool(base["mode"] == "idle" and base["speed"] == 0.0)


def assert_it_stays(links: Path) -> None:
    """For a second of the bench's own time."""
    before = state(links)
    now = before
    while now["time"] < before["time"] + 1.0:
        ended.wait(0.05)
        now = state(links)
    assert now["base"]["pose"] == before["base"]["pose"]


@contextmanager
def driving(links: Path, config: Path, *command: str, **streams: Any) -> Iterator[subprocess.Popen[str]]:
    host = subprocess.Popen(
        [BIN / "labmate-drive", "--port", links / "labmate", "--config", config, *command],
        text=True,
        **({"stdout": subprocess.PIPE, "stderr": subprocess.PIPE} | streams),
    )
    try:
        yield host
    finally:
        if host.poll() is None:
            host.kill()
        host.communicate(timeout=30)


@pytest.mark.real_time
@pytest.mark.parametrize("command", [("go", "20"), ("drive", "0.3", "--for", "60")], ids=lambda c: c[0])
def test_a_host_killed_in_motion_leaves_the_base_at_rest(
    links: Path, config: Path, command: tuple[str, ...]
) -> None:
    with driving(links, config, *command) as host:
        truth_when(links, moving)
        asked = time.monotonic()
        before = truth(links)
        os.kill(host.pid, signal.SIGKILL)
        unknown = time.monotonic() - asked
        assert before["speed"] > 0.05
        after = truth_when(links, at_rest)
    assert at_rest(after)
    # At 0.3 m/s for the watchdog (or the DRIVE's shorter life) and half that for the ramp.
    limit = 0.3 * (unknown + WATCHDOG_S + RAMP_S / 2 + SCHEDULING_S)
    assert 0.0 <= after["pose"]["x"] - before["pose"]["x"] <= limit
    assert_it_stays(links)


@pytest.mark.real_time
@pytest.mark.parametrize(
    ("number", "command"),
    [
        (signal.SIGINT, ("go", "20")),
        (signal.SIGTERM, ("turn", "3600")),
        (signal.SIGHUP, ("drive", "0.2", "5", "--for", "60")),
    ],
    ids=lambda value: value.name if isinstance(value, signal.Signals) else value[0],
)
def test_a_signal_stops_the_base_and_the_stop_is_confirmed(
    links: Path, config: Path, number: signal.Signals, command: tuple[str, ...]
) -> None:
    with driving(links, config, *command) as host:
        truth_when(
            links,
            lambda base: base["mode"] in ("drive", "go", "turn") and base["turn_rate"] + base["speed"] > 0.02,
        )
        host.send_signal(number)
        out, err = host.communicate(timeout=PATIENCE_S)
        # The process has ended: the base is at rest already.
        assert at_rest(truth(links))
    assert host.returncode == 128 + number
    # Above it may be what a busy machine made it repeat.
    assert err.splitlines()[-1] == f"labmate-drive: stopped by {number.name}; the base is at rest"
    assert out == ""
    assert_it_stays(links)


@contextmanager
def at_the_keyboard(links: Path, config: Path) -> Iterator[tuple[subprocess.Popen[str], int]]:
    """A teleop on a terminal of its own, and the other end of that terminal."""
    master, slave = pty.openpty()
    termios.tcsetwinsize(slave, (40, 120))
    with driving(
        links, config, "teleop", stdin=slave, stdout=slave, stderr=slave, start_new_session=True
    ) as host:
        os.close(slave)
        try:
            yield host, master
        finally:
            if host.poll() is None:
                os.close(master)


def shown(master: int, text: str) -> bool:
    """Whether the terminal shows this text, now or in a generous while."""
    deadline, screen = time.monotonic() + PATIENCE_S, ""
    while text not in screen and time.monotonic() < deadline:
        ready, _, _ = select.select([master], [], [], 0.1)
        if ready:
            screen += os.read(master, 65536).decode(errors="replace")
    return text in screen


@contextmanager
def held(master: int, key: bytes) -> Iterator[None]:
    """A key that is held: a terminal repeats it some thirty times a second."""
    released = threading.Event()

    def repeat() -> None:
        with suppress(OSError):
            while not released.wait(0.03):
                os.write(master, key)

    finger = threading.Thread(target=repeat)
    finger.start()
    try:
        yield
    finally:
        released.set()
        finger.join()


@pytest.mark.real_time
def test_teleop_drives_while_a_key_is_held_and_quits_at_rest(links: Path, config: Path) -> None:
    with at_the_keyboard(links, config) as (host, master):
        assert shown(master, "q quit")
        with held(master, b"w"):
            assert truth_when(links, moving)["speed"] > 0.05
        # Released: nothing is written any more, and teleop goes on.
        assert truth_when(links, at_rest)["speed"] == 0.0
        assert host.poll() is None
        with held(master, b"\x1b[D"):
            assert truth_when(links, lambda base: bool(base["turn_rate"] > 0.02))["turn_rate"] > 0.02
        os.write(master, b"q")
        assert shown(master, "at rest at")
        assert host.wait(timeout=PATIENCE_S) == 0
        os.close(master)
    assert at_rest(truth(links))


@pytest.mark.real_time
def test_teleop_stops_when_its_terminal_goes(links: Path, config: Path) -> None:
    with at_the_keyboard(links, config) as (host, master):
        assert shown(master, "q quit")
        with held(master, b"w"):
            assert truth_when(links, moving)["speed"] > 0.05
        # The last stroke is still believed when the terminal goes.
        os.close(master)
        host.wait(timeout=PATIENCE_S)
    # The process has ended by itself: the base is at rest already.
    assert at_rest(truth(links))
    assert_it_stays(links)


@pytest.mark.real_time
def test_a_servo_board_on_the_port_is_named_in_one_line(links: Path) -> None:
    drive = subprocess.run(
        [BIN / "labmate-drive", "--port", links / "mc3000", "status"],
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert drive.returncode == 4
    assert "at 01H answers an MC3000 servo board" in drive.stderr.splitlines()[-1]
    assert "Traceback" not in drive.stderr


@pytest.mark.real_time
@pytest.mark.parametrize("command", ["stop", "estop"])
def test_a_wrong_file_here_keeps_no_base_from_stopping(links: Path, tmp_path: Path, command: str) -> None:
    (tmp_path / "labmate.toml").write_text("limits = \n")
    drive = subprocess.run(
        [BIN / "labmate-drive", "--port", links / "labmate", command],
        capture_output=True,
        text=True,
        timeout=60,
        cwd=tmp_path,
    )
    assert drive.returncode == 0
    first = drive.stderr.splitlines()[0]
    assert first.startswith("labmate.toml: ")
    assert first.endswith("; stopping without it")
    assert truth(links)["emergency_stop"] is (command == "estop")
