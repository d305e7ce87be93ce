"""labmate-drive stopped by SIGSTOP in motion and continued: the base has stopped by its watchdog, and stays."""

import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from sim_devices.control import call

BIN = Path(sys.executable).parent
AWAY_S = 1.3
"""The watchdog's half second, and the six copies of its event within another half."""
PATIENCE_S = 40.0

ended = threading.Event()
"""Never set: its wait lets the other processes run."""


def truth(links: Path) -> dict[str, Any]:
    base: dict[str, Any] = call(links, "inspect")["base"]
    return base


def wait_until(reached: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not reached():
        assert time.monotonic() < deadline
        ended.wait(0.02)


@pytest.mark.real_time
@pytest.mark.parametrize("event", ["kept", "lost"])
def test_a_host_that_was_stopped_in_motion_moves_nothing_when_it_goes_on(
    tmp_path: Path, serving: Callable[[Path, str], AbstractContextManager[Path]], event: str
) -> None:
    config = tmp_path / "base.toml"
    subprocess.run([BIN / "labmate-drive", "--sim", "init", config], check=True, timeout=60)
    with serving(tmp_path, "[[base]]\n") as links:
        command = ["--port", links / "labmate", "--config", config, "drive", "0.2", "--for", "60"]
        with subprocess.Popen(
            [BIN / "labmate-drive", *command], stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
        ) as host:
            try:
                wait_until(lambda: truth(links)["speed"] > 0.1)
                os.kill(host.pid, signal.SIGSTOP)
                if event == "lost":
                    call(links, "wire.faults", {"line": "labmate", "drop": 1.0, "direction": "to_host"})
                ended.wait(AWAY_S)
                wait_until(lambda: truth(links)["speed"] == 0.0 and truth(links)["mode"] == "idle")
                ended.wait(0.6)
                if event == "lost":
                    call(links, "wire.faults", {"line": "labmate"})
                at_rest = truth(links)
                os.kill(host.pid, signal.SIGCONT)
                out, told = host.communicate(timeout=PATIENCE_S)
            finally:
                host.kill()
        assert truth(links)["pose"] == at_rest["pose"]
    assert host.returncode == 6
    assert told.count("\n") == 1
    assert "device 10H was not fed for" in told
    assert "its watchdog of 500 ms stops it" in told
    assert out == ""
