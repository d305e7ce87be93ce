"""Requests that wait for their turn, and whose turn it is."""

from collections import deque
from collections.abc import Collection

from medusa.link.messages import HELLO
from medusa.link.request import Request


class RequestQueue(deque[Request]):
    """First come, first served, except that what depends on another waits for it and lets others pass."""

    def next(self, live: Collection[Request], outstanding: int, window: int) -> Request | None:
        """Return the first that nothing holds back, given what is live and how many places are taken.

        No two requests of which the later must act after the earlier are unanswered together; HELLO goes out
        with nothing outstanding, and nothing passes it; what withdraws motion waits for motion that is live.
        """
        if self[0].operation is HELLO:
            return None if outstanding else self[0]
        if outstanding >= window:
            return None
        earlier: list[Request] = []
        for request in self:
            if request.operation is HELLO:
                return None
            if not (
                any(request.depends_on(other) for other in live)
                or any(request.depends_on(other) or (request.moves and other.stops) for other in earlier)
                or (request.stops and any(other.moves for other in live))
            ):
                return request
            earlier.append(request)
        return None

    def has_stop(self) -> bool:
        """Whether a stop waits, which motion must not be repeated past."""
        return any(request.stops for request in self)
