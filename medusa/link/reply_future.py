"""What a request waits for: resumes its task in the turn of the event loop in which the reply came.

An `asyncio.Future` resumes its task one turn later, which costs a third of a short request's time. A `ReplyFuture`
is awaited by a task in the same way (the protocol of `asyncio.isfuture`), but can also be `resume`d at once;
that is allowed only where no task is running, at the end of a reader's callback.
"""

import asyncio
from collections.abc import Callable, Generator
from contextvars import Context
from typing import Any

from medusa.errors import MedusaError


class ReplyFuture:
    """Holds a reply's payload or an error, once; awaited by one task."""

    _asyncio_future_blocking = False
    _outcome: bytes | BaseException | None = None
    _callback: Callable[["ReplyFuture"], object] | None = None
    _context: Context | None = None

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop

    def __await__(self) -> Generator[Any, None, bytes]:
        if self._outcome is None:
            self._asyncio_future_blocking = True
            yield self
        return self.result()

    def settle(self, outcome: bytes | MedusaError) -> bool:
        """Take the outcome in; False when there is one already. `resume` or `resume_soon` has to follow."""
        if self._outcome is not None:
            return False
        self._outcome = outcome
        return True

    def resume(self) -> None:
        """Run the waiting task on, now."""
        callback, self._callback = self._callback, None
        if callback is not None and self._context is not None:
            self._context.run(callback, self)

    def resume_soon(self) -> None:
        """Run the waiting task on in the loop's next turn."""
        if self._callback is not None:
            self._loop.call_soon(self.resume)

    def result(self) -> bytes:
        """Return the payload, or raise the error."""
        if isinstance(self._outcome, bytes):
            return self._outcome
        if self._outcome is None:
            raise asyncio.InvalidStateError("no reply yet")
        raise self._outcome

    def done(self) -> bool:
        """Whether there is an outcome."""
        return self._outcome is not None

    def get_loop(self) -> asyncio.AbstractEventLoop:
        """Return the loop, which a task compares with its own."""
        return self._loop

    def add_done_callback(
        self, callback: Callable[["ReplyFuture"], object], *, context: Context | None = None
    ) -> None:
        """Take in what resumes the waiting task (called by the task itself)."""
        self._callback = callback
        self._context = context if context is not None else Context()
        if self._outcome is not None:
            self.resume_soon()

    def cancel(self, msg: Any = None) -> bool:
        """End the wait with CancelledError (called by the task when it is cancelled)."""
        if self._outcome is not None:
            return False
        self._outcome = asyncio.CancelledError() if msg is None else asyncio.CancelledError(msg)
        self.resume_soon()
        return True
