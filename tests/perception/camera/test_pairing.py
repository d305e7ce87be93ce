"""Two eyes as one: pairs within the bound, one eye alone when the other is late or dead."""

import asyncio

import numpy as np
import pytest

from perception.camera.errors import CameraError, CameraLost
from perception.camera.frame import Frame
from perception.camera.pairing import FramePair, Pairing, paired
from perception.camera.slot import SlotCamera

PIXEL = np.zeros((1, 1), np.uint8)


def frame(stamp: float, sequence: int = 0) -> Frame:
    return Frame(PIXEL, stamp, "", sequence)


def stamps(pair: FramePair | None) -> tuple[float | None, float | None] | None:
    if pair is None:
        return None
    return (pair.left and pair.left.stamp, pair.right and pair.right.stamp)


def test_frames_within_the_bound_are_a_pair_in_whatever_order_they_come() -> None:
    pairing = Pairing(bound=0.005, patience=0.1)
    assert pairing.put(0, frame(1.000), 1.01) is None
    assert stamps(pairing.put(1, frame(1.004), 1.02)) == (1.000, 1.004)
    assert pairing.put(1, frame(2.000), 2.01) is None
    assert stamps(pairing.put(0, frame(2.005), 2.02)) == (2.005, 2.000)


def test_frames_further_apart_than_the_bound_are_never_a_pair() -> None:
    pairing = Pairing(bound=0.005, patience=0.1)
    assert pairing.put(0, frame(1.0), 1.0) is None
    assert pairing.put(1, frame(1.0051), 1.01) is None
    assert stamps(pairing.overdue(1.1)) == (1.0, None)
    assert stamps(pairing.overdue(1.11)) == (None, 1.0051)
    assert pairing.unpaired == 2


def test_a_frame_waits_for_its_partner_no_longer_than_the_patience() -> None:
    pairing = Pairing(bound=0.005, patience=0.1)
    pairing.put(0, frame(1.0), 1.0)
    assert pairing.next_due() == pytest.approx(1.1)
    assert pairing.overdue(1.09) is None
    assert stamps(pairing.overdue(1.1)) == (1.0, None)
    assert pairing.next_due() is None


async def feed(camera: SlotCamera, times: list[float], delay: float = 0.0) -> None:
    loop = asyncio.get_running_loop()
    for k, t in enumerate(times):
        loop.call_at(t + delay, camera.put, frame(t, k))


async def test_pairs_come_as_soon_as_both_frames_are_there() -> None:
    async with SlotCamera("l") as left, SlotCamera("r") as right:
        await feed(left, [0.1, 0.2, 0.3])
        await feed(right, [0.1, 0.2, 0.3], delay=0.03)
        got = []
        async for pair in paired(left, right, bound=0.001, patience=0.05):
            got.append((asyncio.get_running_loop().time(), stamps(pair)))
            if len(got) == 3:
                break
        assert [t for t, _ in got] == pytest.approx([0.13, 0.23, 0.33])
        assert [s for _, s in got] == [(0.1, 0.1), (0.2, 0.2), (0.3, 0.3)]


async def test_one_dead_eye_leaves_the_other_alone_and_it_joins_again() -> None:
    async with SlotCamera("l", stall_after=0.25) as left, SlotCamera("r", stall_after=0.25) as right:
        times = [0.1 * k for k in range(1, 16)]
        await feed(left, times)
        await feed(right, [t for t in times if t < 0.35 or t > 0.95])
        pairs = []
        async for pair in paired(left, right, bound=0.001, patience=0.05):
            pairs.append(pair)
            if pair.stamp > 1.45:
                break
        both = [round(p.stamp, 3) for p in pairs if p.left is not None and p.right is not None]
        alone = [round(p.stamp, 3) for p in pairs if p.right is None]
        assert both == pytest.approx([0.1, 0.2, 0.3, 1.0, 1.1, 1.2, 1.3, 1.4, 1.5])
        assert alone == pytest.approx([0.4, 0.5, 0.6, 0.7, 0.8, 0.9])


async def test_two_dead_eyes_are_an_error() -> None:
    async with SlotCamera("l") as left, SlotCamera("r") as right:
        loop = asyncio.get_running_loop()
        loop.call_later(0.1, left.fail, CameraLost("left is gone"))
        loop.call_later(0.2, right.fail, CameraLost("right is gone"))
        with pytest.raises(CameraError, match="is gone"):
            async for _ in paired(left, right, bound=0.001, patience=0.05):
                pass
        assert loop.time() == pytest.approx(0.2)
