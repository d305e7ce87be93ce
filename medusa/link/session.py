"""A conversation with one device on a line."""

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from contextlib import suppress
from typing import Protocol, TypeVar

from medusa.errors import CommandError, DeviceRestarted, HostGap, MedusaError, PortError
from medusa.link.contact import Contact
from medusa.link.exchange import NEVER, Exchange, State
from medusa.link.exchange_host import Counters
from medusa.link.frame import MAX_PAYLOAD, Message
from medusa.link.messages import (
    CLEAR,
    EMERGENCY_STOP,
    EVENT_MASK,
    HELLO,
    OPERATIONS,
    PING,
    STATISTICS,
    WATCHDOG,
    WHOLE_DEVICE,
    Event,
    Hello,
    Statistics,
    decode_hello,
    decode_ping,
    decode_statistics,
)
from medusa.link.operation import Operation
from medusa.link.reply_future import ReplyFuture
from medusa.link.request import Request
from medusa.link.stream import EventStream

log = logging.getLogger(__name__)

T = TypeVar("T")


class SessionLine(Protocol):
    """What a session needs of the line that carries it."""

    path: str
    closed_because: str
    reply_timeout: float
    suspended: Callable[[], float]

    @property
    def is_open(self) -> bool: ...

    def write(self, frame: bytes) -> None: ...

    def dequeue(self, frame: bytes) -> bool: ...

    def nonce(self) -> int: ...

    def wake(self, reply: ReplyFuture) -> None: ...

    def recover(self) -> None: ...


class Session:
    """One device's requests, replies and events.

    After the port vanished, the device fell silent or restarted, the line reopens and repeats the handshake on
    its own. From then on everything but motion is accepted; operations that move are refused (CommandError) until
    the driver calls `open()` again: it has to restore watchdog, event mask and settings first.
    """

    def __init__(self, line: SessionLine, address: int) -> None:
        self.line = line
        self.address = address
        self.hello: Hello | None = None
        self.generation = 0
        self.may_move = False
        self.wanted = False
        self.send = line.write
        self.dequeue = line.dequeue
        self._exchange = Exchange(address, self, Contact(f"device {address:02X}H", line.suspended))
        self._loop: asyncio.AbstractEventLoop | None = None
        self._timer: asyncio.TimerHandle | None = None
        self._timer_due = NEVER
        self._names = {code: operation.name for code, operation in OPERATIONS.items()}
        self._subscribers: list[Callable[[Event], None]] = []
        self._restart_watchers: list[Callable[[MedusaError], None]] = []
        self._loss_watchers: list[Callable[[MedusaError], None]] = []
        self._gap_watchers: list[Callable[[HostGap], None]] = []
        self._streams: list[EventStream] = []

    @property
    def counters(self) -> Counters:
        """What the host saw of this device: repeats, late replies, events."""
        return self._exchange.counters

    @property
    def is_open(self) -> bool:
        """Whether a HELLO was answered since the device was last lost."""
        return self._exchange.state is State.OPEN

    @property
    def is_silent(self) -> bool:
        """Whether the device answered nothing for a second and no HELLO since."""
        return self._exchange.is_silent

    @property
    def unfed(self) -> float:
        """For how long nothing that was answered has been sent, s; infinity before the watchdog was first on."""
        return self._exchange.contact.unfed(self._time())

    async def open(self) -> Hello:
        """Open a new session with HELLO, after which the machine is at rest, mask and watchdog are off.

        Raises NoReply, PortError or ProtocolError (another protocol).
        """
        self.wanted = True
        self.may_move = False
        hello = await self.handshake()
        self.may_move = True
        return hello

    async def handshake(self) -> Hello:
        """Send HELLO without allowing motion: what the line does on its own after a loss."""
        nonce = self.line.nonce()
        hello = decode_hello(await self.request(HELLO, payload=HELLO.request.pack(nonce)))
        before, self.hello = self.hello, hello
        self.generation += 1
        log.info("device %02XH: session %d, boot count %d", self.address, self.generation, hello.boot_count)
        if before is not None and before.boot_count != hello.boot_count:
            text = (
                f"device {self.address:02X}H has restarted (boot count {before.boot_count}, now "
                f"{hello.boot_count}): homing, pose and mode are invalid"
            )
            _notify(
                self._restart_watchers, DeviceRestarted(text, before=before.boot_count, now=hello.boot_count)
            )
        return hello

    async def request(
        self,
        operation: Operation,
        axis: int = WHOLE_DEVICE,
        payload: bytes = b"",
        *,
        reply_size: int | None = None,
        deadline: float | None = None,
    ) -> bytes:
        """Send one request and return its reply's payload.

        `operation`: what is asked for, and with it how the request depends on others (`Operation`).
        `reply_size`: bytes in a good reply, where the operation leaves them open; another is damage.
        `deadline`: seconds for each of three sendings (default: the line's `reply_timeout`).

        Raises CommandError (the device refused: `status`), NoReply (also Withdrawn, DeviceSilent), PortError,
        DeviceRestarted (answered "no HELLO since power-up"), HostGap (a motion after one). Cancelling is safe.
        """
        line = self.line
        if not line.is_open:
            raise PortError(line.path, line.closed_because)
        if operation.moves and not self.may_move and self._exchange.contact.gap is None:
            raise CommandError(
                f"device {self.address:02X}H, {operation.name}: the session was lost or never opened; no "
                "motion before open()",
                operation=operation.code,
                axis=axis,
            )
        if axis == WHOLE_DEVICE and operation.axis == "one":
            text = f"device {self.address:02X}H, {operation.name}: is for one axis, none was given"
            raise CommandError(text, operation=operation.code)
        if len(payload) > MAX_PAYLOAD:
            text = f"device {self.address:02X}H, {operation.name}: payload of {len(payload)} bytes"
            raise CommandError(f"{text}, at most {MAX_PAYLOAD}", operation=operation.code, axis=axis)
        loop = self._loop
        if loop is None:
            loop = self._loop = asyncio.get_running_loop()
        reply = ReplyFuture(loop)
        if deadline is None:
            deadline = line.reply_timeout
        request = Request(operation, axis, payload, deadline, reply_size, reply)
        exchange = self._exchange
        exchange.submit(request, loop.time())
        if exchange.due < self._timer_due:
            self._arm()
        try:
            return await reply
        except asyncio.CancelledError:
            exchange.cancel(request, loop.time())
            self._arm()
            raise

    def events(self) -> "EventStream":
        """Return a stream of the device's events, each once, from now on."""
        stream = EventStream()
        leave = self.subscribe(stream.put)
        self._streams.append(stream)

        def ended() -> None:
            leave()
            self._streams.remove(stream)

        stream.ended = ended
        return stream

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Call back for each event; returns what ends the subscription."""
        return _enlist(self._subscribers, callback)

    def on_restart(self, callback: Callable[[MedusaError], None]) -> Callable[[], None]:
        """Call back with DeviceRestarted when a HELLO shows another boot count; returns what ends it."""
        return _enlist(self._restart_watchers, callback)

    def on_lost(self, callback: Callable[[MedusaError], None]) -> Callable[[], None]:
        """Call back with PortError, DeviceSilent or DeviceRestarted when the session is lost."""
        return _enlist(self._loss_watchers, callback)

    def on_gap(self, callback: Callable[[HostGap], None]) -> Callable[[], None]:
        """Call back when the device's watchdog has expired, as far as the host can know: motion is over, the
        session goes on, and only `open()` allows motion again."""
        return _enlist(self._gap_watchers, callback)

    async def ping(self) -> int:
        """Return the device's time, µs since its power-up."""
        return decode_ping(await self.request(PING))

    async def statistics(self) -> Statistics:
        """Return the device's own counters."""
        return decode_statistics(await self.request(STATISTICS))

    async def watchdog(self, timeout_ms: int, action: int = 0) -> None:
        """Set the device's watchdog; 0 ms switches it off."""
        await self.request(WATCHDOG, payload=WATCHDOG.request.pack(timeout_ms, action))

    async def emergency_stop(self) -> None:
        """Stop this device at once and latch it."""
        await self.request(EMERGENCY_STOP)

    async def clear(self, axis: int = WHOLE_DEVICE) -> None:
        """Release what is latched and whose cause is gone."""
        await self.request(CLEAR, axis)

    async def event_mask(self, mask: int) -> None:
        """Let the events of the mask through (bit n: event 40H + n)."""
        await self.request(EVENT_MASK, payload=EVENT_MASK.request.pack(mask))

    def describe(
        self, operations: Iterable[Operation], events: Mapping[int, str], *, event_size: int | None
    ) -> None:
        """Take in the device's own operations, its events' names, and the payload size of every event.

        With the sizes a frame that ran into the next one, which the CRC does not notice, is dropped and asked
        for again.
        """
        self._names.update({operation.code: operation.name for operation in operations})
        self._names.update(events)
        self._exchange.event_size = event_size

    def name(self, operation: int) -> str:
        """Return the operation's name for messages."""
        return self._names.get(operation) or f"operation {operation:02X}H"

    def receive(self, message: Message, now: float) -> None:
        """Take in a message that the line received from this device."""
        exchange = self._exchange
        exchange.receive(message, now)
        if exchange.due < self._timer_due:
            self._arm()

    def look(self) -> None:
        """Notice a gap before something leaves that is not a request of this session."""
        self._exchange.look(self._time())

    def withdraw_motion(self) -> None:
        """Withdraw every unanswered motion: a broadcast stop goes out."""
        self._exchange.withdraw(self._time())

    def lose(self, reason: str, *, expected: bool = False) -> None:
        """End everything under way with PortError; `expected` when we close the port ourselves."""
        self.may_move = False
        self._exchange.lose(self.line.path, reason, self._time())
        if expected:
            self._disarm()
            for stream in list(self._streams):
                stream.close()
        else:
            _notify(self._loss_watchers, PortError(self.line.path, reason))

    def finish(self, request: Request, result: bytes | MedusaError) -> None:
        """Hand the reply's payload, or the error, to the one who asked."""
        reply = request.reply
        if reply is not None and reply.settle(result):
            self.line.wake(reply)

    def deliver(self, event: Event) -> None:
        """Hand an event on."""
        _notify(self._subscribers, event)

    def lost(self, error: MedusaError) -> None:
        """The device answers no more, or has restarted: repeat the handshake until it answers."""
        log.warning("%s", error)
        self.may_move = False
        _notify(self._loss_watchers, error)
        self.line.recover()

    def interrupted(self, gap: HostGap) -> None:
        """The device's watchdog has expired: no motion before `open()`."""
        log.debug("%s", gap)
        self.may_move = False
        _notify(self._gap_watchers, gap)

    def _time(self) -> float:
        if self._loop is None:
            self._loop = asyncio.get_running_loop()
        return self._loop.time()

    def _arm(self) -> None:
        """Keep one timer for all deadlines; one that is early enough stays, and looks again when it fires."""
        due = self._exchange.due
        if due < self._timer_due:
            if self._timer is not None:
                self._timer.cancel()
            if self._loop is None:
                self._loop = asyncio.get_running_loop()
            self._timer_due = due
            self._timer = self._loop.call_at(due, self._expire)

    def _disarm(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer, self._timer_due = None, NEVER

    def _expire(self) -> None:
        self._timer, self._timer_due = None, NEVER
        self._exchange.expire(self._time())
        self._arm()


def _notify(callbacks: Sequence[Callable[[T], None]], what: T) -> None:
    """Call everybody back; one that fails is logged and keeps nobody else from being called."""
    for callback in list(callbacks):
        try:
            callback(what)
        except Exception:
            log.exception("a callback failed on %s", what)


def _enlist(callbacks: list[Callable[[T], None]], callback: Callable[[T], None]) -> Callable[[], None]:
    callbacks.append(callback)

    def leave() -> None:
        with suppress(ValueError):
            callbacks.remove(callback)

    return leave
