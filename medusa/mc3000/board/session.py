"""The conversation with a board: handshake, watchdog, motions under way, events."""

import asyncio
import logging
from collections.abc import Callable

from medusa.errors import DeviceSilent, NoReply, ProtocolError
from medusa.link import Event, Hello, Session
from medusa.link.messages import WHOLE_DEVICE
from medusa.link.operation import Operation
from medusa.mc3000.board import messages
from medusa.mc3000.board.clock import BoardClock
from medusa.mc3000.board.messages import BoardEvent
from medusa.mc3000.board.operations import AXES, INPUTS, OPERATIONS
from medusa.mc3000.board.registers import WatchdogAction

log = logging.getLogger(__name__)

READ_TRIES = 3
FRAME_OVERHEAD = 8
"""Bytes around a payload on the wire: four of the message, two of the CRC, COBS code and delimiter."""
BITS_PER_BYTE = 10


class BoardSession:
    """The conversation with one board: its HELLO, its clock, when its last reply came, its motions under way."""

    def __init__(self, session: Session, *, baud: int = 115200) -> None:
        self.session = session
        self.clock = BoardClock()
        self.received_at = float("-inf")
        """When the last reply came, s on the loop's clock."""
        self._motions = 0
        self._motions_answered = asyncio.Event()
        self._motions_answered.set()
        session.on_restart(lambda restarted: self.clock.reset())
        session.describe(OPERATIONS, messages.EVENT_NAMES, event_size=messages.EVENT_SIZE)
        self._seconds_per_byte = BITS_PER_BYTE / baud

    @property
    def address(self) -> int:
        """Address on the line."""
        return self.session.address

    @property
    def clock_hz(self) -> int:
        """Clock of the chips as the HELLO reported it; raises ProtocolError before the first."""
        return messages.decode_board_part(self._hello().part)[1]

    @property
    def boot_count(self) -> int:
        """Boot count of the last HELLO; raises ProtocolError before it."""
        return self._hello().boot_count

    @property
    def firmware(self) -> int:
        """Firmware version of the present session, high byte the major."""
        return self._hello().firmware

    @property
    def repeats(self) -> int:
        """Requests that the link had to repeat so far."""
        return self.session.counters.repeats

    def _hello(self) -> Hello:
        if self.session.hello is None:
            raise ProtocolError(f"board {self.address:02X}H has not answered a HELLO yet")
        return self.session.hello

    @property
    def may_move(self) -> bool:
        """Whether motion is allowed: from `open` until the board restarts or is lost."""
        return self.session.may_move

    @property
    def awaits_handshake(self) -> bool:
        """True while the line is there but the board, restarted, has not answered a HELLO yet."""
        session = self.session
        return session.line.is_open and not session.is_open and not session.is_silent

    async def open(self) -> Hello:
        """Open a session, after which the board is at rest with its watchdog off, and let every event through.

        Raises NoReply, PortError, or ProtocolError for a device that is no MC3000 of three axes.
        """
        hello = await self.session.open()
        if hello.device_type != messages.DEVICE_TYPE:
            raise ProtocolError(
                f"device {self.address:02X}H is of type {hello.device_type},"
                f" not an MC3000 ({messages.DEVICE_TYPE})"
            )
        axes, _ = messages.decode_board_part(hello.part)
        if axes != AXES:
            raise ProtocolError(f"board {self.address:02X}H has {axes} axes, {AXES} expected")
        self.clock.reset()
        self._stamp_reply()
        await self.session.event_mask(messages.EVENT_MASK_ALL)
        return hello

    def _stamp_reply(self) -> None:
        self.received_at = asyncio.get_running_loop().time()

    async def _request(
        self,
        operation: Operation,
        axis: int = WHOLE_DEVICE,
        payload: bytes = b"",
        *,
        reply_size: int | None = None,
        deadline: float | None = None,
    ) -> bytes:
        if operation.moves:
            self._motions += 1
            self._motions_answered.clear()
        try:
            reply = await self.session.request(
                operation, axis, payload, reply_size=reply_size, deadline=deadline
            )
        finally:
            if operation.moves:
                self._motions -= 1
                if self._motions == 0:
                    self._motions_answered.set()
        self._stamp_reply()
        return reply

    async def _read(
        self,
        operation: Operation,
        axis: int = WHOLE_DEVICE,
        payload: bytes = b"",
        *,
        reply_size: int | None = None,
        deadline: float | None = None,
    ) -> bytes:
        """The reply to a request that only reads, asked anew when the link's repeats were not answered."""
        for _ in range(READ_TRIES - 1):
            try:
                return await self._request(operation, axis, payload, reply_size=reply_size, deadline=deadline)
            except DeviceSilent:
                raise
            except NoReply as error:
                log.warning("asking again: %s", error)
        return await self._request(operation, axis, payload, reply_size=reply_size, deadline=deadline)

    async def feed(self, deadline: float) -> None:
        """Feed the watchdog by asking for an axis' inputs, with `deadline` (s) for each sending.

        Not by PING, which a restarted board answers as if nothing had happened.
        """
        await self._read(INPUTS, 0, deadline=deadline)

    async def ping(self) -> int:
        """The board's time, µs since power-up; feeds the watchdog."""
        time_us = await self.session.ping()
        self._stamp_reply()
        return time_us

    async def watchdog(self, timeout_ms: int, action: WatchdogAction = WatchdogAction.IDLE) -> None:
        """Set the watchdog; 0 ms switches it off and sets open-loop motor commands to zero."""
        await self.session.watchdog(timeout_ms, action)
        self._stamp_reply()

    async def clear(self, axis: int = WHOLE_DEVICE) -> None:
        """Release what is latched and whose cause is gone; what remains is to be read back."""
        await self.session.clear(axis)

    def subscribe(self, callback: Callable[[BoardEvent], None]) -> Callable[[], None]:
        """Call back with each typed event; returns what ends the subscription."""

        def typed(event: Event) -> None:
            callback(messages.decode_event(event.operation, event.axis, event.payload))

        return self.session.subscribe(typed)
