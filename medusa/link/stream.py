"""Events as an asynchronous iterator."""

import asyncio
import logging
from collections import deque
from collections.abc import Callable
from typing import Final, Self

from medusa.link.messages import Event

log = logging.getLogger(__name__)

_MAX_KEPT: Final = 1024


class EventStream:
    """Each event once, from when the stream was made; ends when the line is closed or `close()` is called.

    A reader that falls more than 1024 events behind loses the oldest, with a warning.
    """

    def __init__(self) -> None:
        self.ended: Callable[[], None] = lambda: None
        self._kept: deque[Event] = deque(maxlen=_MAX_KEPT)
        self._arrived = asyncio.Event()
        self._closed = False

    def __aiter__(self) -> Self:
        return self

    async def __anext__(self) -> Event:
        while not self._kept:
            if self._closed:
                raise StopAsyncIteration
            self._arrived.clear()
            await self._arrived.wait()
        return self._kept.popleft()

    def put(self, event: Event) -> None:
        """Take an event in."""
        if len(self._kept) == _MAX_KEPT:
            log.warning("an event was lost: the reader of the stream is %d events behind", _MAX_KEPT)
        self._kept.append(event)
        self._arrived.set()

    def close(self) -> None:
        """End the stream after what it holds."""
        if not self._closed:
            self._closed = True
            self._arrived.set()
            self.ended()
