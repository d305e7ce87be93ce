"""The camera's file and the distortion it holds."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.camera.intrinsics import Intrinsics
from perception.depth.errors import OptionError
from perception.depth.estimator import DepthFromMotion
from perception.depth.files.lens import pinhole, read_lens, undistort
from tools.depth.scenes import slanted_plane

PINHOLE = "fx = 200.0\nfy = 201.0\ncx = 79.5\ncy = 59.5\n"


def read(tmp_path: Path, text: str) -> Intrinsics:
    path = tmp_path / "camera.toml"
    path.write_text(text)
    return read_lens(path, (160, 120))


def test_a_pinhole_leaves_the_image_alone(tmp_path: Path) -> None:
    lens = read(tmp_path, PINHOLE)
    image = np.arange(160 * 120, dtype=np.uint8).reshape(120, 160)
    assert undistort(lens, image) is image
    assert pinhole(lens).fy == 201.0


def test_depth_through_a_bent_lens_is_as_right_as_through_a_straight_one(tmp_path: Path) -> None:
    sequence = slanted_plane(frames=3, size=(160, 120))
    camera = sequence.camera
    numbers = f"fx = {camera.fx}\nfy = {camera.fy}\ncx = {camera.cx}\ncy = {camera.cy}\n"
    lens = read(tmp_path, "[camera]\n" + numbers + "distortion = [0.2, -0.3, 0.004, -0.003, 0.1]\n")
    pixels = np.stack(np.meshgrid(np.arange(160.0), np.arange(120.0)), -1)
    # a pixel of the bent image sees what the straight one shows where its ray goes
    rays = lens.rays(pixels).astype(np.float32)
    x, y = camera.fx * rays[..., 0] + camera.cx, camera.fy * rays[..., 1] + camera.cy
    bent = [cv2.remap(image, x, y, cv2.INTER_CUBIC) for image in sequence.images]

    def error(images: list[np.ndarray]) -> float:
        estimator = DepthFromMotion(pinhole(lens))
        estimator.start(images[0])
        for image, motion in zip(images[1:], sequence.motions, strict=True):
            found = estimator.step(image, motion)
        part = np.abs(found.state.value - sequence.truth[-1]) / sequence.truth[-1]
        return float(np.median(part[15:-15, 15:-15]))

    assert error([undistort(lens, image) for image in bent]) < 0.003
    assert error(bent) > 0.006


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (PINHOLE + "distortion = [0.1, 0.2]\n", "distortion = [0.1, 0.2], five numbers k1, k2, p1, p2, k3"),
        (PINHOLE + "distortion = [0, 0, 0, 0, inf]\n", "distortion = inf, a number is needed"),
        (PINHOLE + "width = 640\nheight = 480\n", "width = 640, the images have 160×120 pixels"),
        (PINHOLE.replace("fx = 200.0", "fx = -1.0"), "fx = -1.0: a focal length in pixels is positive"),
        (PINHOLE.replace("cy", "c_y"), "cy = None, a number of pixels is needed"),
    ],
)
def test_a_wrong_file_is_named_with_what_is_wrong(tmp_path: Path, text: str, message: str) -> None:
    with pytest.raises(OptionError) as error:
        read(tmp_path, text)
    assert str(error.value).startswith(f"{tmp_path / 'camera.toml'}: {message}")
