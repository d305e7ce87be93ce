"""The amplifiers' multidrop line: one command at a time, whichever amplifier it is for."""

import asyncio
import logging
from contextlib import suppress
from dataclasses import dataclass, replace
from types import TracebackType
from typing import Final, Self

from medusa.errors import CommandError, MedusaError, NoReply, PortError, ProtocolError
from medusa.link.port import Port, retry_pauses
from medusa.link.trace import TO_DEVICE, TO_HOST, Trace
from medusa.servo_amp.amplifier import Amplifier, expect_words
from medusa.servo_amp.frame import (
    COMPLETE,
    DATA_CRC_ERROR,
    INCOMPLETE,
    INVALID_COMMAND,
    NO_WRITE_ACCESS,
    READ,
    WRITE,
    Command,
    RejectedBytes,
    Reply,
    ReplyDecoder,
    encode_command,
    encode_reply,
)
from medusa.servo_amp.registers import AmplifierRegister

log = logging.getLogger(__name__)

REPLY_S: Final = 0.05
QUIET_S: Final = 0.02
NEVER_QUIET_S: Final = 1.0
MAX_SENDINGS: Final = 3
_BITS_PER_BYTE: Final = 10
_REPLY_OVERHEAD: Final = 10
_STATUS_TEXT: Final = {INVALID_COMMAND: "invalid command", NO_WRITE_ACCESS: "no write access"}


@dataclass
class AmplifierLineCounters:
    """What the host counted on the line."""

    commands: int = 0
    repeats: int = 0
    late_replies: int = 0
    rejected: int = 0


class AmplifierLine:
    """A port, the amplifiers on it, and the rule that only one command is under way.

    A command unanswered after 50 ms is repeated when the line was quiet for 20 ms, twice at most. A port that
    vanishes ends the command under way with PortError and is opened again with growing pauses; nothing is sent
    by that.
    """

    def __init__(
        self,
        path: str,
        *,
        baud: int = 115200,
        trace: Trace | None = None,
        name: str = "amps",
        peak_current: float = 20.0,
    ) -> None:
        """Describe the line; `peak_current` in A is the drives' KP, which scales their currents."""
        self.path = path
        self.name = name
        self.baud = baud
        self.peak_current = peak_current
        self.counters = AmplifierLineCounters()
        self._port = Port(path, baud, self._received, self._vanished)
        self._closed_because = "not open"
        self._trace = trace
        self._decoder = ReplyDecoder()
        self._turn = asyncio.Lock()
        self._sequence = 0
        self._expected: asyncio.Future[Reply] | None = None
        self._sequence_expected = 0
        self._unanswered = 0
        self._received_at = 0.0
        self._answers_until = 0.0
        self._recovery: asyncio.Task[None] | None = None

    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, where: TracebackType | None
    ) -> None:
        await self.close()

    async def open(self) -> None:
        """Open the port; raises PortError."""
        self._port.open()
        # What an earlier host left unanswered may still come.
        self._answers_until = self._received_at = asyncio.get_running_loop().time()

    async def close(self) -> None:
        """Close the port; what is still unanswered raises PortError."""
        if self._recovery is not None:
            self._recovery.cancel()
            with suppress(asyncio.CancelledError):
                await self._recovery
            self._recovery = None
        self._closed_because = "closed"
        self._port.close()
        self._fail(PortError(self.path, "closed", may_have_acted=True))

    def amplifier(self, address: int) -> Amplifier:
        """The amplifier at this address; raises ValueError outside 01H–3FH."""
        if not 0x01 <= address <= 0x3F:
            raise ValueError(f"address {address:02X}H, allowed 01H–3FH")
        return Amplifier(self, address)

    async def read(self, address: int, register: AmplifierRegister) -> bytes:
        """A register's words; raises CommandError, NoReply, PortError, ProtocolError."""
        command = Command(address, READ, 0, register.index, register.offset, register.words)
        reply = await self._ask(command)
        return expect_words(reply.data, register, encode_reply(reply))

    async def write(self, address: int, register: AmplifierRegister, data: bytes) -> None:
        """Write a register's words; raises CommandError (status 6: no write access), NoReply, PortError."""
        await self._ask(Command(address, WRITE, 0, register.index, register.offset, len(data) // 2, data))

    async def _ask(self, command: Command) -> Reply:
        """Carry one command out, alone on the line."""
        async with self._turn:
            command = replace(command, sequence=self._sequence)
            self._sequence = (self._sequence + 1) % 16
            self.counters.commands += 1
            try:
                await self._settle()
                return await self._converse(command)
            finally:
                self._expected = None
                if self._unanswered:
                    # Cancelled or given up: nobody speaks before that answer has come or can come no more.
                    self._answers_until = _now() + self._reply_time(command)

    async def _converse(self, command: Command) -> Reply:
        frame = encode_command(command)
        failure = "no answer"
        for sending in range(MAX_SENDINGS):
            if not self._port.is_open:
                raise PortError(self.path, self._closed_because, may_have_acted=sending > 0)
            if sending:
                self.counters.repeats += 1
                log.warning("%s: %s: %s, repeated", self.name, _describe(command), failure)
            reply = await self._exchange(command, frame)
            if reply is None:
                failure = "no answer"
            elif reply.status == COMPLETE:
                return reply
            elif reply.status in _STATUS_TEXT:
                text = f"{_describe(command)}: {_STATUS_TEXT[reply.status]} (status {reply.status})"
                raise CommandError(text, status=reply.status, operation=command.index)
            elif reply.status in (DATA_CRC_ERROR, INCOMPLETE):
                failure = f"answered with status {reply.status}"
            else:
                text = f"{_describe(command)}: unknown status {reply.status}"
                raise ProtocolError(text, frame=encode_reply(reply))
            if self._port.dequeue(frame):
                failure = "the port takes no bytes"
                raise NoReply(f"{_describe(command)}: {failure}", frame=frame, may_have_acted=sending > 0)
        raise NoReply(f"{_describe(command)}: {failure}, {MAX_SENDINGS} sendings", frame=frame)

    async def _exchange(self, command: Command, frame: bytes) -> Reply | None:
        """Send a command once; return its reply, None when none came before the line was quiet again."""
        expected: asyncio.Future[Reply] = asyncio.get_running_loop().create_future()
        self._expected = expected
        self._sequence_expected = command.sequence
        self._unanswered += 1
        self._decoder.reset()
        self._record(TO_DEVICE, frame, f"#{command.sequence} {_describe(command)}")
        self._port.write(frame)
        await asyncio.wait([expected], timeout=self._reply_time(command))
        if not expected.done():
            await self._settle()
        return expected.result() if expected.done() else None

    async def _settle(self) -> None:
        """Wait until no answer can come any more and the line was quiet for 20 ms; raises NoReply after a second."""
        end = _now() + NEVER_QUIET_S
        while (pause := max(self._answers_until, self._received_at + QUIET_S) - _now()) > 0:
            if not (self._unanswered or self._answers_until):
                return
            if _now() >= end:
                raise NoReply(
                    f"{self.name}: the line is never quiet", may_have_acted=self._expected is not None
                )
            await asyncio.sleep(pause)
        self._answers_until = 0.0
        if self._expected is None:
            self._unanswered = 0

    def _reply_time(self, command: Command) -> float:
        """50 ms, and the time that the command and its reply take on the wire."""
        size = len(encode_command(command)) + _REPLY_OVERHEAD + 2 * command.words
        return REPLY_S + size * _BITS_PER_BYTE / self.baud

    def _received(self, data: bytes) -> None:
        self._received_at = _now()
        for item in self._decoder.feed(data):
            if isinstance(item, RejectedBytes):
                self.counters.rejected += 1
                self._record(TO_HOST, item.frame, f"dropped: {item.reason}")
                continue
            self._record(
                TO_HOST, encode_reply(item), f"#{item.sequence} status {item.status} {item.data.hex()}"
            )
            expected = self._expected
            if expected is None or item.sequence != self._sequence_expected:
                self.counters.late_replies += 1
                continue
            self._unanswered -= 1
            if not expected.done():
                expected.set_result(item)

    def _fail(self, error: PortError) -> None:
        if self._expected is not None and not self._expected.done():
            self._expected.set_exception(error)
            # Its caller may have been cancelled meanwhile: nobody need look at the error then.
            self._expected.exception()

    def _vanished(self, reason: str) -> None:
        self._closed_because = f"{reason}; it is being opened again"
        self._fail(PortError(self.path, reason, may_have_acted=True))
        if self._recovery is None or self._recovery.done():
            self._recovery = asyncio.get_running_loop().create_task(self._recover())

    async def _recover(self) -> None:
        for pause in retry_pauses():
            await asyncio.sleep(pause)
            with suppress(MedusaError):
                await self.open()
                log.info("%s: open again", self.path)
                return

    def _record(self, direction: str, data: bytes, meaning: str) -> None:
        log.debug("%s %s %s %s", self.name, direction, data.hex(), meaning)
        if self._trace is not None:
            self._trace.record(_now(), self.name, direction, data, meaning.strip())


def _now() -> float:
    return asyncio.get_running_loop().time()


def _describe(command: Command) -> str:
    what = "write" if command.type & WRITE else "read"
    data = f" = {command.data.hex()}" if command.data else ""
    return f"amplifier {command.address:02X}H, {what} {command.index:02X}.{command.offset:02X}{data}"
