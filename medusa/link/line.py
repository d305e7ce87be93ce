"""A serial line with one or more framed devices on it."""

import asyncio
import logging
import os
import random
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Final, Self

from medusa.errors import MedusaError, NoReply, PortError
from medusa.link.contact import seconds_suspended
from medusa.link.frame import (
    ACKNOWLEDGEMENT,
    EVENT,
    KIND_NAMES,
    REPLY,
    REQUEST,
    Decoder,
    Message,
    Rejected,
    encode_frame,
)
from medusa.link.messages import BROADCAST, EMERGENCY_STOP, OPERATIONS, PING, WHOLE_DEVICE
from medusa.link.operation import Operation
from medusa.link.port import Port, retry_pauses
from medusa.link.reply_future import ReplyFuture
from medusa.link.session import Session
from medusa.link.trace import TO_DEVICE, TO_HOST, Trace

log = logging.getLogger(__name__)

EMERGENCY_BROADCASTS: Final = 3


class Line:
    """A port, the frames on it and a session for each address.

    A port that vanishes is opened again, and the handshake with a lost device is repeated, with growing pauses;
    neither sends anything but HELLO.
    """

    def __init__(
        self,
        path: str,
        *,
        baud: int = 115200,
        trace: Trace | None = None,
        name: str = "line",
        reply_timeout: float = 0.1,
        seed: int | None = None,
        suspended: Callable[[], float] = seconds_suspended,
    ) -> None:
        """Describe the line; `seed` makes the HELLO nonces repeatable, which only a simulation may want.

        `suspended`: for how long the host has been suspended so far, s.
        """
        self.path = path
        self.name = name
        self.reply_timeout = reply_timeout
        self.suspended = suspended
        self.closed_because = "not open"
        self.decoder = Decoder()
        self._sessions: dict[int, Session] = {}
        self._port = Port(path, baud, self._received, self._vanished, self._look)
        self._trace = trace
        self._seeded = None if seed is None else random.Random(seed)
        self._broadcasts = 0
        self._recovery: asyncio.Task[None] | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._closing = False
        self._woken: list[ReplyFuture] | None = None

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def is_open(self) -> bool:
        return self._port.is_open

    async def open(self) -> None:
        """Open the port; raises PortError."""
        self._loop = asyncio.get_running_loop()
        self._closing = False
        self._port.open()

    async def close(self) -> None:
        """Close the port; what is still unanswered raises PortError."""
        self._closing = True
        self.closed_because = "closed"
        if self._recovery is not None:
            self._recovery.cancel()
            with suppress(asyncio.CancelledError):
                await self._recovery
            self._recovery = None
        self._port.close()
        for session in self._sessions.values():
            session.lose("closed", expected=True)

    def session(self, address: int) -> Session:
        """Return the one session with this address; raises ValueError outside 01H–7EH."""
        if not 0x01 <= address <= 0x7E:
            raise ValueError(f"address {address:02X}H, allowed 01H–7EH")
        if address not in self._sessions:
            self._sessions[address] = Session(self, address)
        return self._sessions[address]

    async def emergency_stop(self) -> None:
        """Broadcast EMERGENCY_STOP three times, then send it to each address and wait for the answers.

        Raises NoReply naming the devices that did not confirm it, PortError when the port is gone.
        """
        for session in self._sessions.values():
            session.withdraw_motion()
        for _ in range(EMERGENCY_BROADCASTS):
            self._broadcast(EMERGENCY_STOP)
        sessions = list(self._sessions.values())
        results = await asyncio.gather(*(s.emergency_stop() for s in sessions), return_exceptions=True)
        unconfirmed: list[str] = []
        for session, result in zip(sessions, results, strict=True):
            if isinstance(result, PortError) or (result and not isinstance(result, MedusaError)):
                raise result
            if isinstance(result, MedusaError):
                unconfirmed.append(f"{session.address:02X}H")
        if unconfirmed:
            raise NoReply(f"emergency stop sent, but not confirmed by {', '.join(unconfirmed)}")

    def ping_all(self) -> bool:
        """Feed every watchdog with a broadcast PING; withheld (False) while any device is silent.

        Nobody answers it: a device from which nothing else is heard for its watchdog's time counts as not fed.
        """
        self._look()
        if not self.is_open or any(session.is_silent for session in self._sessions.values()):
            return False
        self._broadcast(PING)
        return True

    def nonce(self) -> int:
        """Return a new nonce for a HELLO."""
        if self._seeded is not None:
            return self._seeded.getrandbits(16)
        return int.from_bytes(os.urandom(2), "little")

    def recover(self) -> None:
        """Open again what was lost and repeat its handshake, in the background."""
        if not self._closing and (self._recovery is None or self._recovery.done()):
            self._recovery = asyncio.get_running_loop().create_task(self._recover())

    def write(self, frame: bytes) -> None:
        """Write a frame behind those written before."""
        if self._trace is not None:
            self._record(TO_DEVICE, frame)
        self._port.write(frame)

    def dequeue(self, frame: bytes) -> bool:
        """Take back a frame of which no byte has left the host yet."""
        return self._port.dequeue(frame)

    def _broadcast(self, operation: Operation) -> None:
        frame = encode_frame(Message(BROADCAST, REQUEST, self._broadcasts, operation.code, WHOLE_DEVICE))
        self._broadcasts = (self._broadcasts + 1) % 64
        if self._trace is not None:
            self._record(TO_DEVICE, frame)
        self._port.write_ahead(frame)

    def wake(self, reply: ReplyFuture) -> None:
        """Resume who awaits a reply: at the end of the read that brought it, else in the next turn."""
        if self._woken is None:
            reply.resume_soon()
        else:
            self._woken.append(reply)

    def _look(self) -> None:
        for session in self._sessions.values():
            session.look()

    def _received(self, data: bytes) -> None:
        woken: list[ReplyFuture] = []
        self._woken = woken
        try:
            now = self._loop.time() if self._loop is not None else 0.0
            for item in self.decoder.feed(data):
                if self._trace is not None:
                    self._record(TO_HOST, item)
                if type(item) is Message:
                    session = self._sessions.get(item.address)
                    if session is not None:
                        session.receive(item, now)
                    else:
                        log.debug("%s: a message from %02XH, whom nobody asked", self.name, item.address)
                else:
                    log.debug("%s: dropped (%s) %s", self.name, *item)
        finally:
            self._woken = None
        try:
            while woken:
                woken.pop(0).resume()
        finally:
            # Only a KeyboardInterrupt or the like leaves any.
            for reply in woken:
                reply.resume_soon()

    def _record(self, direction: str, what: bytes | Message | Rejected) -> None:
        if self._trace is None or self._loop is None:
            return
        item = Decoder().feed(what)[0] if isinstance(what, bytes) else what
        now = self._loop.time()
        if isinstance(item, Rejected):
            self._trace.record(now, self.name, direction, item.frame, f"dropped: {item.reason}")
        else:
            self._trace.record(now, self.name, direction, encode_frame(item), self._meaning(item))

    def _meaning(self, message: Message) -> str:
        address, kind, sequence, operation, axis, payload = message
        session = self._sessions.get(address)
        name = f"{operation:02X}H" if session is None else session.name(operation)
        if address == BROADCAST:
            name = OPERATIONS[operation].name if operation in OPERATIONS else name
        words = [
            f"{address:02X}",
            KIND_NAMES[kind],
            f"#{sequence}",
            _event_name(operation, name) if kind in (EVENT, ACKNOWLEDGEMENT) else name,
        ]
        if kind == REPLY:
            words.append(f"status {axis}")
        elif axis != WHOLE_DEVICE and kind != ACKNOWLEDGEMENT:
            words.append(f"axis {axis}")
        return " ".join([*words, payload.hex()] if payload else words)

    def _vanished(self, reason: str) -> None:
        self.closed_because = f"{reason}; it is being opened again"
        self.decoder.reset()
        for session in self._sessions.values():
            session.lose(reason)
        self.recover()

    async def _recover(self) -> None:
        for pause in retry_pauses():
            await asyncio.sleep(pause)
            try:
                if not self._port.is_open:
                    self._port.open()
                    log.info("%s: open again", self.path)
                lost = [s for s in self._sessions.values() if s.wanted and not s.is_open]
                for session in lost:
                    await session.handshake()
                if not any(s.wanted and not s.is_open for s in self._sessions.values()):
                    return
            except MedusaError as error:
                log.debug("not recovered yet: %s", error)


def _event_name(operation: int, name: str) -> str:
    known = name.removeprefix("event ")
    return f"{operation:02X}H" if known.startswith("operation ") else known
