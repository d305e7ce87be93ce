"""The Labmate's session kept fit for motion: limits, watchdog and events set, fed, and known to be set."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

from labmate.base.feeding import keep_fed
from labmate.config import BaseConfig
from labmate.driver import messages as m
from labmate.errors import StopNotConfirmed
from medusa.errors import MedusaError, NoReply, PortError
from medusa.link import Event, Hello, Line, Operation, Session

log = logging.getLogger(__name__)

_MC3000 = 1
_FOUND_MOVING = 10.0
"""Longest ramp (s) that an earlier host's limits are granted: from 1 m/s at 0.1 m/s²."""
_RAMP = 0
"""The base's only watchdog action: ramp to a stop."""
_NEIGHBOURS = (0x01, 0x02, 0x10, 0x11)
"""Where else something answers when somebody mistook the port or the address: boards of a head, further bases."""


class Connection:
    """One Labmate on a line. `config` None: it can be read and stopped, not moved."""

    def __init__(
        self,
        line: Line,
        path: str,
        config: BaseConfig | None,
        address: int,
        *,
        on_event: Callable[[Event], None],
        on_loss: Callable[[MedusaError], None],
    ) -> None:
        self.path = path
        self.config = config
        self.line = line
        self.session: Session = line.session(address)
        self.session.describe(m.OPERATIONS, m.EVENT_NAMES, event_size=m.EVENT_SIZE)
        self._on_event = on_event
        self._on_loss = on_loss
        self._unsubscribe: list[Callable[[], None]] = []
        self._keeper: asyncio.Task[None] | None = None

    async def open(self) -> Hello:
        """Open a session with the base and prepare it; raises PortError when something else answers, or nothing."""
        hello = await self._handshake()
        if not self._unsubscribe:
            self._unsubscribe = [
                self.session.subscribe(self._on_event),
                self.session.on_restart(self._on_loss),
                self.session.on_lost(self._on_loss),
                self.session.on_gap(self._on_loss),
            ]
        await self._prepare()
        if self.config is not None and self._keeper is None:
            session = self.session
            feed = keep_fed(self.config.safety.watchdog_ms * 1e-3, lambda: session.unfed, session.ping)
            self._keeper = asyncio.get_running_loop().create_task(feed)
        return hello

    async def close(self, *, watchdog_off: bool) -> None:
        """End the feeding; the watchdog is switched off only when the base is known to be at rest."""
        if self._keeper is not None:
            self._keeper.cancel()
        if watchdog_off and self.config is not None:
            try:
                await self.session.watchdog(0)
            except MedusaError as error:
                log.warning("%s: the watchdog stays on: %s", self.path, error)
        for unsubscribe in self._unsubscribe:
            unsubscribe()
        self._unsubscribe.clear()

    async def request(self, operation: Operation, payload: bytes = b"") -> bytes:
        """Send one request to the base as a whole."""
        return await self.session.request(operation, payload=payload)

    async def _handshake(self) -> Hello:
        address = self.session.address
        try:
            hello = await self.session.open()
        except NoReply as error:
            if self._unsubscribe:
                # It was the right one before; a HELLO to its neighbours would stop them.
                raise
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
            reason = f"the base still moves {_FOUND_MOVING:g} s after it was told to stop"
            raise StopNotConfirmed(f"{self.path}: {reason}") from None
        limits = self.config.motion_limits
        await self.request(
            m.LIMITS,
            m.SetLimits(
                limits.speed, limits.turn_rate, limits.acceleration, limits.turn_acceleration
            ).encode(),
        )
        await self.session.event_mask(m.EVENT_MASK)
        await self.session.watchdog(self.config.safety.watchdog_ms, _RAMP)


def _kind(hello: Hello) -> str:
    names = {_MC3000: "an MC3000 servo board", m.DEVICE_TYPE: "a Labmate base"}
    return names.get(hello.device_type, f"a device of unknown type {hello.device_type}")
