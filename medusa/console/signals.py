"""A coroutine that SIGINT, SIGTERM and SIGHUP cancel once, so that what it drives is stopped on the way out."""

import asyncio
import contextlib
import signal
import sys
from collections.abc import Awaitable, Callable
from typing import TypeVar

T = TypeVar("T")

SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)


async def cancelled_by_signals(
    body: Callable[[], Awaitable[T]], caught: list[signal.Signals], still_stopping: str
) -> T:
    """Run `body`; the first signal cancels it, each further one only prints `still_stopping`.

    `caught` takes the signals in their order. A SIGHUP that is ignored stays so: that is what nohup asks for.
    """
    loop = asyncio.get_running_loop()
    task = asyncio.current_task()

    def stop(number: signal.Signals) -> None:
        caught.append(number)
        if task is not None and len(caught) == 1:
            task.cancel()
        else:
            # A second cancellation would end the stopping itself.
            with contextlib.suppress(OSError):
                print(still_stopping, file=sys.stderr, flush=True)

    for number in SIGNALS:
        if number is signal.SIGHUP and signal.getsignal(number) is signal.SIG_IGN:
            continue
        # Not available outside the main thread, as in a test runner's worker.
        with contextlib.suppress(RuntimeError, ValueError):
            loop.add_signal_handler(number, stop, number)
    return await body()
