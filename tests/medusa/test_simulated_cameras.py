"""The emulated head sees: both cameras give frames in virtual time, from where its joints stand."""

import asyncio
from typing import Any

import numpy as np
import pytest

from medusa.simulation import simulated_head
from perception.camera.pairing import paired
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig

LAMP_AHEAD = TargetConfig(azimuth_deg=PathConfig(), elevation_deg=PathConfig())


async def first_pairs(seed: int, count: int) -> list[tuple[float, Any, Any]]:
    world = WorldConfig(target=LAMP_AHEAD, cameras=CamerasConfig(width=64, height=64, noise=2.0))
    async with simulated_head(seed, world=world) as simulation, simulation.cameras() as (left, right):
        pairs = []
        async for pair in paired(left, right, bound=0.001, patience=0.05):
            assert pair.left is not None
            assert pair.right is not None
            pairs.append((pair.stamp, pair.left.image, pair.right.image))
            if len(pairs) == count:
                return pairs
    raise AssertionError("the cameras ended")


async def test_both_eyes_give_pairs_at_their_rate() -> None:
    pairs = await first_pairs(3, 4)
    stamps = [stamp for stamp, _, _ in pairs]
    assert np.diff(stamps) == pytest.approx([1 / 6] * 3)


async def test_two_runs_with_one_seed_see_the_same() -> None:
    first, again = await first_pairs(3, 3), await first_pairs(3, 3)
    for (t0, left0, right0), (t1, left1, right1) in zip(first, again, strict=True):
        assert t1 - t0 == pytest.approx(again[0][0] - first[0][0])
        assert np.array_equal(left0, left1)
        assert np.array_equal(right0, right1)


async def test_a_homed_head_sees_a_lamp_ahead_between_its_eyes() -> None:
    world = WorldConfig(target=LAMP_AHEAD, cameras=CamerasConfig(width=64, height=64, noise=0.0))
    async with (
        simulated_head(1, world=world) as simulation,
        simulation.open() as head,
    ):
        await head.enable()
        await head.home()
        async with simulation.cameras() as (left, right):
            await asyncio.sleep(0.2)
            columns = []
            for camera in (left, right):
                frame = camera.latest()
                assert frame is not None
                columns.append(float(np.mean(np.nonzero(frame.image > 200)[1])))
    lens = simulation.intrinsics()
    # 65 mm to the side at 1.2 m: the left eye sees it to the right. Whole pixels at the rim: half a pixel.
    shift = lens.fx * 0.065 / 1.2
    assert columns == pytest.approx([lens.cx + shift, lens.cx - shift], abs=0.5)


async def test_a_head_without_a_world_has_no_cameras() -> None:
    async with simulated_head(1) as simulation:
        with pytest.raises(ValueError, match="without a world"):
            async with simulation.cameras():
                pass
