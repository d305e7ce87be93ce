"""The gaze on the wall clock: emulated boards and cameras in one process, medusa-ctl in another."""

import json
import math
import subprocess
import sys
from pathlib import Path

import pytest

from medusa.mc3000.simulated_config import simulated_toml

pytestmark = pytest.mark.real_time
DEADLINE_S = 120


def test_track_follows_over_ptys_and_tcp_as_it_would_over_cables(tmp_path: Path) -> None:
    (tmp_path / "medusa.toml").write_text(simulated_toml())
    (tmp_path / "bench.toml").write_text(
        "base = []\n[world.cameras]\nwidth = 64\nheight = 64\nrate_hz = 10.0\n"
    )
    focal = 32.0 / math.tan(math.radians(20.0))
    eyes = "".join(
        f"[{side}]\nwidth = 64\nheight = 64\nfx = {focal}\nfy = {focal}\ncx = 31.5\ncy = 31.5\n"
        for side in ("left", "right")
    )
    (tmp_path / "cameras.toml").write_text(eyes + "[head]\nbaseline_m = 0.13\n")
    serve = [sys.executable, "-c", "from sim_devices.cli import main; main()", "run", "--seed", "3"]
    serve += ["--config", "bench.toml", "--links", "sim"]
    with subprocess.Popen(serve, cwd=tmp_path, stdout=subprocess.PIPE, text=True) as bench:
        try:
            assert bench.stdout is not None
            announced = dict(line.split() for line in iter(bench.stdout.readline, "ready\n"))
            for axis in ("tilt", "left_vergence", "right_vergence", "pan"):
                medusa_ctl(tmp_path, "check", axis)
            medusa_ctl(tmp_path, "home")
            eyes_at = ["--left", announced["camera-left"], "--right", announced["camera-right"]]
            words = [*eyes_at, "--cameras", "cameras.toml", "--rate", "10", "--seconds", "5"]
            document = medusa_ctl(tmp_path, "track", *words)
        finally:
            bench.terminate()
    # No figure of speed or error is held to a bound here: the machine may be busy. It saw, jumped and followed.
    assert document["seen"] > 0
    assert document["pictures"] > 0
    assert document["rms_error_deg"] is not None
    assert set(document["cameras"]) == {"left", "right"}


def medusa_ctl(folder: Path, *words: str) -> dict[str, object]:
    command = [sys.executable, "-c", "from medusa.cli import main; main()", "--json"]
    command += ["--boards", "sim/mc3000", "--amps", "sim/servo-amps", *words]
    ended = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=DEADLINE_S, check=False
    )
    assert ended.returncode == 0, ended.stderr
    document: dict[str, object] = json.loads(ended.stdout)
    return document
