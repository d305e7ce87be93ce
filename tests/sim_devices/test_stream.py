"""Cameras of a bench in a process of its own: OpenCV opens them like any other address."""

import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from sim_devices.stream import frame, header


def test_the_stream_begins_with_the_header_of_a_grey_video() -> None:
    assert header(64, 48, 6.0) == b"YUV4MPEG2 W64 H48 F6:1 Ip A1:1 Cmono\n"
    assert header(8, 8, 29.97).split()[3] == b"F2997:100"


def test_a_frame_is_its_rows_one_after_the_other() -> None:
    assert frame(np.array([[1, 2], [3, 4]], np.uint8)) == b"FRAME\n\x01\x02\x03\x04"


def served(tmp_path: Path, text: str, cameras: tuple[str, ...]) -> dict[str, np.ndarray]:
    """One picture of each camera of a bench of its own, as OpenCV gets it from the announced address."""
    config = tmp_path / "bench.toml"
    config.write_text(text)
    command = [sys.executable, "-c", "from sim_devices.cli import main; main()", "run", "--seed", "1"]
    command += ["--config", str(config), "--links", str(tmp_path / "links")]
    pictures = {}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        try:
            announced = {}
            for line in process.stdout:
                if line.strip() == "ready":
                    break
                name, address = line.split()
                announced[name] = address
            for name in cameras:
                capture = cv2.VideoCapture(announced[f"camera-{name}"], cv2.CAP_FFMPEG)
                got, pictures[name] = capture.read()
                assert got
                capture.release()
        finally:
            process.terminate()
            assert process.wait(30) == 0
    return pictures


@pytest.mark.real_time
def test_sim_devices_run_serves_both_cameras_to_opencv(tmp_path: Path) -> None:
    text = (
        "base = []\n[world.cameras]\nwidth = 48\nheight = 32\nrate_hz = 30.0\n"
        '[world.target]\nkind = "texture"\n'
    )
    for picture in served(tmp_path, text, ("left", "right")).values():
        assert picture.shape == (32, 48, 3)
        assert picture.std() > 5.0  # textured walls


@pytest.mark.real_time
def test_sim_devices_run_serves_the_window_of_a_camera_on_a_base(tmp_path: Path) -> None:
    text = (
        'head = false\nplan = "corridor"\n[[camera]]\nname = "side"\nrate_hz = 30.0\n'
        'mount = { on = "base", y = 0.3, z = 0.35, yaw_deg = 90.0 }\nwindow = [96, 112, 64, 32]\n'
    )
    picture = served(tmp_path, text, ("side",))["side"]
    assert picture.shape == (32, 64, 3)
    assert picture.std() > 5.0
