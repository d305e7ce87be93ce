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


class Beat:
    """Steps at every multiple of a period, up to an end."""

    def __init__(self, period, end):
        self.period, self.end = period, end
        self.steps = []

    def next_step(self):
        due = (len(self.steps) + 1) * self.period
        return due if due <= self.end else float("inf")

    def step(self, now):
        self.steps.append((now, asyncio.get_running_loop().time()))


def test_steps_run_between_timers_each_at_its_own_time():
    async def run():
        loop = asyncio.get_running_loop()
        quick, slow = Beat(0.25, 10.0), Beat(0.75, 10.0)
        loop.add_stepper(quick)
        loop.add_stepper(slow)
        await asyncio.sleep(1.6)
        seen = len(quick.steps), len(slow.steps)
        await asyncio.sleep(1.0)
        loop.remove_stepper(quick)
        await asyncio.sleep(100.0)
        return seen, quick.steps, slow.steps, loop.time()

    seen, quick, slow, end = run_virtual(run())
    assert seen == (6, 2)
    assert quick == [(0.25 * n, 0.25 * n) for n in range(1, 11)]
    assert slow == [(0.75 * n, 0.75 * n) for n in range(1, 14)]
    assert end == 102.6


def test_a_step_may_set_the_timer_that_the_loop_waits_for():
    async def run():
        loop = asyncio.get_running_loop()
        done = asyncio.Event()

        class Once(Beat):
            def step(self, now):
                super().step(now)
                loop.call_at(now + 0.5, done.set)

        loop.add_stepper(Once(2.0, 2.0))
        await done.wait()
        return loop.time()

    assert run_virtual(run()) == 2.5


def test_endless_steps_do_not_keep_what_is_ready_waiting():
    async def run():
        loop = asyncio.get_running_loop()
        beat = Beat(0.005, float("inf"))
        loop.add_stepper(beat)
        # Only the thread's answer ends this, and no timer is set.
        await asyncio.to_thread(lambda: None)
        loop.remove_stepper(beat)
        return True

    assert run_virtual(run())
