"""What has to be carried through is, although its caller is cancelled, and cancelled again."""

import asyncio

import pytest

from medusa.completion import run_to_completion


async def test_a_cancelled_caller_waits_for_the_end() -> None:
    ended = []

    async def stop() -> None:
        await asyncio.sleep(1.0)
        ended.append(asyncio.get_running_loop().time())

    caller = asyncio.ensure_future(run_to_completion(stop()))
    for _ in range(3):
        await asyncio.sleep(0.1)
        caller.cancel()
    with pytest.raises(asyncio.CancelledError):
        await caller
    assert ended == [pytest.approx(1.0)]


async def test_result_and_error_reach_the_caller() -> None:
    async def result() -> int:
        return 3

    async def error() -> None:
        raise ZeroDivisionError

    assert await run_to_completion(result()) == 3
    with pytest.raises(ZeroDivisionError):
        await run_to_completion(error())


async def test_an_error_of_the_work_is_the_cause_of_the_cancellation() -> None:
    async def fail() -> None:
        await asyncio.sleep(0.1)
        raise ZeroDivisionError

    caller = asyncio.ensure_future(run_to_completion(fail()))
    await asyncio.sleep(0.05)
    caller.cancel()
    with pytest.raises(asyncio.CancelledError) as cancelled:
        await caller
    assert isinstance(cancelled.value.__cause__, ZeroDivisionError)
