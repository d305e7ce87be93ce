"""Between an exchange, which decides, and the session, which carries out."""

from dataclasses import dataclass
from typing import Protocol

from medusa.errors import HostGap, MedusaError
from medusa.link.messages import Event
from medusa.link.request import Request


class ExchangeHost(Protocol):
    """Who runs an exchange: it carries out what the exchange decides."""

    def send(self, frame: bytes) -> None:
        """Write a frame behind those written before."""

    def dequeue(self, frame: bytes) -> bool:
        """Take back a frame of which no byte has left the host yet; False when it has gone."""

    def finish(self, request: Request, result: bytes | MedusaError) -> None:
        """Hand the reply's payload, or the error, to the one who asked."""

    def deliver(self, event: Event) -> None:
        """Hand an event on."""

    def lost(self, error: MedusaError) -> None:
        """The device answers no more, or has restarted."""

    def interrupted(self, gap: HostGap) -> None:
        """The device's watchdog has expired; its motions are withdrawn, the session goes on."""


@dataclass
class Counters:
    """What the host saw of one device; late, damaged and stray messages were dropped."""

    requests: int = 0
    repeats: int = 0
    late_replies: int = 0
    damaged: int = 0
    stray: int = 0
    events: int = 0
    events_repeated: int = 0
    events_dropped: int = 0
