import asyncio
import os

import pytest

from sim_devices.clock import ScaledTimeLoop, VirtualTimeLoop, run_virtual


def test_time_begins_at_zero_and_jumps_to_the_next_timer():
    async def sleep():
        loop = asyncio.get_running_loop()
        times = [loop.time()]
        for seconds in (1e6, 0.1, 1e-7):
            await asyncio.sleep(seconds)
            times.append(loop.time())
        return times

    assert run_virtual(sleep()) == [0.0, 1e6, 1e6 + 0.1, 1e6 + 0.1 + 1e-7]


def test_a_timer_fires_at_its_own_time_to_the_last_bit():
    async def fire():
        loop = asyncio.get_running_loop()
        fired = []
        # Thirds and sevenths: sums of differences of these do not come out even.
        whens = sorted({n / 3 for n in range(50)} | {n / 7 for n in range(100)})
        for when in whens:
            loop.call_at(when, lambda when=when: fired.append((when, loop.time())))
        await asyncio.sleep(20)
        return fired

    assert all(when == at for when, at in run_virtual(fire()))


def test_a_byte_that_is_written_is_seen_before_the_clock_moves():
    async def talk():
        loop = asyncio.get_running_loop()
        master, slave = os.openpty()
        os.set_blocking(master, False)
        seen = []
        loop.add_reader(master, lambda: seen.append((loop.time(), os.read(master, 100))))
        for n in range(200):
            os.write(slave, b"x")
            await asyncio.sleep(0.001)
            assert len(seen) == n + 1
        loop.remove_reader(master)
        os.close(master)
        os.close(slave)
        return [t for t, _ in seen]

    assert run_virtual(talk()) == pytest.approx([n * 0.001 for n in range(200)])


def test_without_timers_the_loop_waits_for_a_thread():
    async def ask():
        return await asyncio.to_thread(lambda: 42)

    assert run_virtual(ask()) == 42


def test_a_deadline_passes_in_virtual_time():
    async def wait():
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(3600):
                await asyncio.Event().wait()
        return asyncio.get_running_loop().time()

    assert run_virtual(wait()) == 3600


async def test_tests_run_in_virtual_time():
    assert isinstance(asyncio.get_running_loop(), VirtualTimeLoop)
    await asyncio.sleep(86400 * 365)


@pytest.mark.real_time
def test_a_scaled_loop_passes_its_seconds_faster():
    async def sleep():
        await asyncio.sleep(100)
        return asyncio.get_running_loop().time()

    with asyncio.Runner(loop_factory=lambda: ScaledTimeLoop(1000)) as runner:
        assert runner.run(sleep()) >= 100


@pytest.mark.parametrize("speed", [0, -1, float("nan")])
def test_a_speed_must_be_positive(speed):
    with pytest.raises(ValueError, match="must be above 0"):
        ScaledTimeLoop(speed)
