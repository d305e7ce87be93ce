"""The base's session kept fit for motion: limits, watchdog and events set, fed, and known to be set.

Motion is possible only between a preparation (HELLO, LIMITS, WATCHDOG, EVENT_MASK) and the next loss of the
line or of the base's memory; after one the program has to say `recover()` itself.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from labmate.config import BaseConfig
from labmate.driver import messages as m
from labmate.driver.messages import HelloPart
from labmate.errors import StopNotConfirmed
from medusa.errors import DeviceFault, DeviceRestarted, MedusaError, NoReply, PortError
from medusa.link import Event, Hello, Line, Operation, Session

_LOG = logging.getLogger(__name__)

_MC3000 = 1
_FOUND_MOVING = 10.0
"""Longest ramp (s) that an earlier host's limits are granted: from 1 m/s at 0.1 m/s²."""
_RAMP = 0
"""The base's only watchdog action: ramp to a stop."""
_NEIGHBOURS = (0x01, 0x02, 0x10, 0x11)
"""Where else something answers when somebody mistook the port or the address: boards of a head, further bases."""


class Connection:
    """One base on a line. `config` None: it can be read and stopped, not moved."""

    def __init__(
        self,
        line: Line,
        path: str,
        config: BaseConfig | None,
        address: int,
        *,
        on_event: Callable[[Event], None],
        on_trouble: Callable[[MedusaError], None],
    ) -> None:
        self.path = path
        self.config = config
        self.line = line
        self.session: Session = line.session(address)
        self.session.describe(m.OPERATIONS, m.EVENT_NAMES, event_size=m.EVENT_SIZE)
        self._on_event = on_event
        self._on_trouble = on_trouble
        self._unsubscribe: list[Callable[[], None]] = []
        self._trouble: MedusaError | None = None
        self._fed_at = 0.0
        self._keeper: asyncio.Task[None] | None = None

    async def open(self) -> HelloPart:
        """Greet and prepare the base; raises PortError when something else answers, or nothing."""
        hello = await self._greet()
        self._unsubscribe = [
            self.session.subscribe(self._on_event),
            self.session.on_restart(self._note_trouble),
            self.session.on_lost(self._note_trouble),
            self.session.on_gap(self._note_trouble),
        ]
        await self._prepare()
        if self.config is not None:
            period = self.config.safety.watchdog_ms * 1e-3 / 3.0
            self._keeper = asyncio.get_running_loop().create_task(self._keep_alive(period))
        return HelloPart.decode(hello.part)

    async def recover(self) -> HelloPart:
        """Open a new session after a loss or restart; the base stands, and motion is possible again."""
        hello = await self.session.open()
        await self._prepare()
        self._trouble = None
        _LOG.info("%s: the base is ready again", self.path)
        return HelloPart.decode(hello.part)

    async def close(self, *, standing: bool) -> None:
        """End the keeping; switch the watchdog off only when the base is known to stand."""
        if self._keeper is not None:
            self._keeper.cancel()
        if standing and self._trouble is None and self.config is not None:
            try:
                await self.session.watchdog(0)
            except MedusaError as error:
                _LOG.warning("%s: the watchdog stays on: %s", self.path, error)
        for unsubscribe in self._unsubscribe:
            unsubscribe()

    @property
    def restarted(self) -> bool:
        """Whether the base has lost its memory since the last preparation."""
        return isinstance(self._trouble, DeviceRestarted)

    def require_ready(self) -> None:
        """Raise what made motion impossible since the last preparation."""
        if isinstance(self._trouble, DeviceRestarted):
            raise DeviceRestarted(
                f"{self._trouble}; its pose is void: recover() before it moves",
                before=self._trouble.before,
                now=self._trouble.now,
            ) from self._trouble
        if self._trouble is not None:
            raise DeviceFault(f"{self._trouble}; recover() before it moves") from self._trouble

    async def request(self, operation: Operation, payload: bytes = b"") -> bytes:
        """One request to the base as a whole; every answered one feeds the watchdog."""
        asked_at = asyncio.get_running_loop().time()
        try:
            reply = await self.session.request(operation, payload=payload)
        except DeviceRestarted as error:
            if not self.restarted:
                self._note_trouble(error)
            raise
        self._fed_at = max(self._fed_at, asked_at)
        return reply

    async def _greet(self) -> Hello:
        address = self.session.address
        try:
            hello = await self.session.open()
        except NoReply as error:
            found = await self._neighbour()
            advice = found or "is it the right port, is the base switched on?"
            raise PortError(self.path, f"no base answers at address {address:02X}H; {advice}") from error
        if hello.device_type != m.DEVICE_TYPE:
            raise PortError(
                self.path,
                f"at address {address:02X}H answers {_kind(hello)}, not a Labmate base: wrong device",
            )
        return hello

    async def _neighbour(self) -> str | None:
        for address in _NEIGHBOURS:
            if address == self.session.address:
                continue
            try:
                hello = await self.line.session(address).open()
            except NoReply:
                continue
            return f"at {address:02X}H answers {_kind(hello)}: wrong device or address?"
        return None

    async def _prepare(self) -> None:
        """LIMITS, events, watchdog. A base found in motion is ramping down by the HELLO: LIMITS has to wait for it."""
        if self.config is None:
            return
        try:
            async with asyncio.timeout(_FOUND_MOVING):
                while True:
                    if m.StatusReply.decode(await self.request(m.STATUS)).at_rest:
                        break
                    await asyncio.sleep(0.05)
        except TimeoutError:
            told = f"{self.path}: the base still moves {_FOUND_MOVING:g} s after it was told to stop"
            raise StopNotConfirmed(told) from None
        await self.request(m.LIMITS, self.config.wire_limits.encode())
        await self.session.event_mask(m.EVENT_MASK)
        await self.session.watchdog(self.config.safety.watchdog_ms, _RAMP)
        self._fed_at = asyncio.get_running_loop().time()

    def _note_trouble(self, error: MedusaError) -> None:
        if not self.restarted:
            self._trouble = error
        self._on_trouble(error)

    async def _keep_alive(self, period: float) -> None:
        """PING whenever nothing else has fed the watchdog for a third of its time."""
        loop = asyncio.get_running_loop()
        while True:
            rest = self._fed_at + period - loop.time()
            # A rest below the clock's resolution would be slept for ever.
            if rest > 1e-3:
                await asyncio.sleep(rest)
                continue
            asked_at = loop.time()
            try:
                await self.session.ping()
                self._fed_at = max(self._fed_at, asked_at)
            except MedusaError as error:
                _LOG.debug("%s: keep-alive: %s", self.path, error)
                await asyncio.sleep(period)


def _kind(hello: Hello) -> str:
    names = {_MC3000: "an MC3000 servo board", m.DEVICE_TYPE: "a Labmate base"}
    return names.get(hello.device_type, f"a device of unknown type {hello.device_type}")
