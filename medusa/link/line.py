"""A serial line with one or more framed devices on it."""

from types import TracebackType
from typing import Self

from medusa.link.session import Session
from medusa.link.trace import Trace


class Line:
    """A port, the frames on it and a session for each address."""

    def __init__(
        self,
        path: str,
        *,
        baud: int = 115200,
        trace: Trace | None = None,
        name: str = "line",
        reply_timeout: float = 0.1,
        seed: int | None = None,
    ) -> None:
        raise NotImplementedError

    async def __aenter__(self) -> Self:
        raise NotImplementedError

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        raise NotImplementedError

    async def open(self) -> None:
        """Open the port; raises PortError."""
        raise NotImplementedError

    async def close(self) -> None:
        """Close the port; what is still unanswered raises PortError."""
        raise NotImplementedError

    def session(self, address: int) -> Session:
        """Return the one session with this address (01H–7EH)."""
        raise NotImplementedError

    async def emergency_stop(self) -> None:
        """Broadcast EMERGENCY_STOP three times, then send it to each address and wait for the answers."""
        raise NotImplementedError

    def ping_all(self) -> bool:
        """Feed every watchdog with a broadcast PING; withheld (False) while any device is silent."""
        raise NotImplementedError
