"""The latest-frame slot: newest wins, drops are counted, silence and changed sizes are errors."""

import asyncio

import numpy as np
import pytest

from perception.camera.errors import CameraLost, CameraStalled, FrameSizeChanged
from perception.camera.frame import CameraStatistics, Frame
from perception.camera.slot import SlotCamera


def frame(sequence: int, stamp: float = 0.0, size: tuple[int, int] = (4, 3)) -> Frame:
    return Frame(np.zeros((size[1], size[0]), np.uint8), stamp, "left", sequence)


async def test_latest_is_none_before_the_first_frame_and_then_the_newest() -> None:
    async with SlotCamera("left") as camera:
        assert camera.latest() is None
        camera.put(frame(0))
        camera.put(frame(1))
        newest = camera.latest()
        assert newest is not None
        assert newest.sequence == 1


async def test_frames_that_nobody_took_and_gaps_in_the_sequence_count_as_dropped() -> None:
    async with SlotCamera("left") as camera:
        camera.put(frame(0))
        camera.put(frame(1))  # 0 was never taken
        camera.latest()
        camera.put(frame(5))  # 2, 3, 4 never came
        assert camera.statistics == CameraStatistics(received=3, dropped=4, reopened=0)


async def test_a_slow_reader_gets_the_newest_frame_not_the_next() -> None:
    async with SlotCamera("left") as camera:
        loop = asyncio.get_running_loop()
        for k in range(10):
            loop.call_later(0.1 * k + 0.05, camera.put, frame(k))
        seen = []
        async for taken in camera.frames():
            seen.append(taken.sequence)
            if taken.sequence == 9:
                break
            await asyncio.sleep(0.32)
        assert seen == [0, 3, 6, 9]


async def test_a_silent_camera_is_stalled_after_its_time_and_says_both_times() -> None:
    async with SlotCamera("left", stall_after=0.5) as camera:
        start = asyncio.get_running_loop().time()
        with pytest.raises(CameraStalled, match=r"left.*0\.50 s"):
            await anext(camera.frames())
        assert asyncio.get_running_loop().time() - start == pytest.approx(0.5)
        await asyncio.sleep(0.1)
        with pytest.raises(CameraStalled):
            camera.latest()
        camera.put(frame(3))
        assert camera.latest() is not None


async def test_a_frame_of_another_size_is_an_error_until_the_camera_is_reopened() -> None:
    async with SlotCamera("left") as camera:
        camera.put(frame(0))
        camera.put(frame(1, size=(8, 6)))
        with pytest.raises(FrameSizeChanged, match=r"4 x 3.*8 x 6"):
            camera.latest()
        camera.reopened()
        camera.put(frame(2, size=(8, 6)))
        newest = camera.latest()
        assert newest is not None
        assert newest.size == (8, 6)
        assert camera.statistics.reopened == 1


async def test_a_failure_reaches_everyone_who_waits() -> None:
    async with SlotCamera("left") as camera:
        waiting = [asyncio.ensure_future(anext(camera.frames())) for _ in range(3)]
        await asyncio.sleep(0.1)
        camera.fail(CameraLost("unplugged"))
        outcomes = await asyncio.gather(*waiting, return_exceptions=True)
        assert [type(outcome) for outcome in outcomes] == [CameraLost] * 3
