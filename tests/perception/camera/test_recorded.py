"""Folders and videos: paced by the loop's clock, ending and failing by name."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from perception.camera.device import CaptureSettings, open_camera
from perception.camera.errors import CameraLost, CameraNotFound
from perception.camera.frame import Camera, Frame


async def take_all(camera: Camera, frames: list[Frame]) -> None:
    async for frame in camera.frames():
        frames.append(frame)  # noqa: PERF401 (what came before the error must stay)


def folder_of(path: Path, levels: list[int]) -> Path:
    for k, level in enumerate(levels):
        cv2.imwrite(str(path / f"image{k:03d}.png"), np.full((6, 8), level, np.uint8))
    return path


async def test_a_folder_plays_in_the_order_of_names_at_the_given_rate(tmp_path: Path) -> None:
    async with open_camera(str(folder_of(tmp_path, [10, 20, 30])), CaptureSettings(rate=5.0)) as camera:
        frames: list[Frame] = []
        with pytest.raises(CameraLost, match="after 3 images"):
            await take_all(camera, frames)
        got = [(frame.stamp, int(frame.image[0, 0]), frame.size) for frame in frames]
        assert got == [(0.0, 10, (8, 6)), (0.2, 20, (8, 6)), (0.4, 30, (8, 6))]


async def test_a_repeated_folder_begins_again(tmp_path: Path) -> None:
    camera = open_camera(str(folder_of(tmp_path, [10, 20])), CaptureSettings(rate=10.0), repeat=True)
    async with camera:
        levels = []
        async for frame in camera.frames():
            levels.append(int(frame.image[0, 0]))
            if len(levels) == 5:
                break
        assert levels == [10, 20, 10, 20, 10]


async def test_a_video_plays_its_frames(tmp_path: Path) -> None:
    path = tmp_path / "video.avi"
    writer = cv2.VideoWriter(str(path), cv2.VideoWriter.fourcc(*"MJPG"), 10.0, (32, 24))
    for level in (40, 90, 140):
        writer.write(np.full((24, 32, 3), level, np.uint8))
    writer.release()
    async with open_camera(str(path), CaptureSettings(rate=10.0)) as camera:
        frames: list[Frame] = []
        with pytest.raises(CameraLost):
            await take_all(camera, frames)
    levels = [float(frame.image.mean()) for frame in frames]
    assert levels == pytest.approx([40.0, 90.0, 140.0], abs=3.0)  # JPEG


async def test_what_is_not_there_or_not_a_image_is_named(tmp_path: Path) -> None:
    with pytest.raises(CameraNotFound, match=r"nowhere\.avi"):
        open_camera(str(tmp_path / "nowhere.avi"))
    with pytest.raises(CameraNotFound, match="no images"):
        async with open_camera(str(tmp_path)):
            pass
    with pytest.raises(CameraNotFound, match="video97"):
        open_camera("97")
    with pytest.raises(CameraNotFound, match="by-id"):
        open_camera("usb-No_Such_Camera-index0")
    with pytest.raises(CameraNotFound, match="no camera given"):
        open_camera("")
    (tmp_path / "broken.avi").write_bytes(b"not a video")
    with pytest.raises(CameraNotFound, match="no image can be read"):
        async with open_camera(str(tmp_path / "broken.avi")):
            pass


async def test_a_broken_image_in_the_middle_is_an_error_not_a_silence(tmp_path: Path) -> None:
    folder_of(tmp_path, [10, 20, 30])
    (tmp_path / "image001.png").write_bytes(b"not an image")
    async with open_camera(str(tmp_path), CaptureSettings(rate=5.0)) as camera:
        with pytest.raises(CameraLost, match=r"image001\.png"):
            await take_all(camera, [])
