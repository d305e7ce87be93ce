"""The servo amplifiers: enabled while the axes are idle, inhibited only at rest, faults cleared."""

import logging
from collections.abc import Awaitable, Callable, Collection, Mapping

from medusa.errors import DeviceFault
from medusa.servo_amp import Amplifier

log = logging.getLogger(__name__)


class Amplifiers:
    """The amplifiers of all joints; `enabled` names those that this host has enabled, `rest` waits for rest."""

    def __init__(
        self,
        amplifiers: Mapping[str, Amplifier],
        rest: Callable[[Collection[str]], Awaitable[None]],
        watchdog_ms: int,
    ) -> None:
        self.enabled: frozenset[str] = frozenset()
        self._amplifiers = amplifiers
        self._rest = rest
        self._watchdog_ms = watchdog_ms

    async def is_enabled(self, name: str) -> bool:
        """True when this host enabled the amplifier and it still is: it may have restarted."""
        return name in self.enabled and (await self._amplifiers[name].status()).enabled

    async def enable(self, name: str) -> None:
        """Enable the amplifier of an idle axis, and its watchdog.

        Raises DeviceFault naming a joint that stays inhibited.
        """
        amplifier = self._amplifiers[name]
        status = await amplifier.status()
        if status.was_reset:
            await amplifier.reset_events()
        # Named first: an amplifier whose enabling is not confirmed may be enabled, and has to be inhibited again.
        self.enabled |= {name}
        try:
            await amplifier.enable()
        except DeviceFault as error:
            raise DeviceFault(f"{name}: {error}", axis=name) from None
        await amplifier.watchdog(self._watchdog_ms)

    async def inhibit(self, names: Collection[str]) -> None:
        """Wait until the idle axes are at rest, then inhibit their amplifiers.

        Raises DeviceFault naming the joints that do not come to rest; their amplifiers stay enabled and brake them.
        """
        braked = False
        try:
            await self._rest(names)
        except DeviceFault as error:
            # At a closed switch the amplifier's directional inhibit keeps it from braking: its brake does not.
            log.warning("%s; braking", error)
            braked = True
            for name in names:
                await self._amplifiers[name].brake(True)
            await self._rest(names)
        for name in names:
            await self._amplifiers[name].watchdog(0)
            await self._amplifiers[name].inhibit()
            if braked:
                await self._amplifiers[name].brake(False)
            self.enabled -= {name}

    async def clear(self) -> None:
        """Reset the amplifiers' events, and end what a host that died has left enabled or watched."""
        left = []
        for name, amplifier in self._amplifiers.items():
            if name not in self.enabled:
                # Nobody feeds it any more: it would latch its fault again as soon as this host is gone.
                await amplifier.watchdog(0)
                if (await amplifier.status()).enabled:
                    left.append(name)
        if left:
            await self.inhibit(left)
        for amplifier in self._amplifiers.values():
            await amplifier.reset_events()
