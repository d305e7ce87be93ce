"""The amplifiers' bridges: switched on while the axes are idle, off only at rest, faults cleared."""

import logging
from collections.abc import Collection, Mapping

from medusa.errors import DeviceFault
from medusa.head.stopping import Stopping
from medusa.servo_amp import Amplifier

log = logging.getLogger(__name__)


class Bridges:
    """The bridges of a head's joints; `on` names those that this host has switched on."""

    def __init__(self, amplifiers: Mapping[str, Amplifier], stopping: Stopping, watchdog_ms: int) -> None:
        self.on: frozenset[str] = frozenset()
        self._amplifiers = amplifiers
        self._stopping = stopping
        self._watchdog_ms = watchdog_ms

    async def is_on(self, name: str) -> bool:
        """True when this host switched the bridge on and it still is: an amplifier may have restarted."""
        return name in self.on and (await self._amplifiers[name].status()).enabled

    async def switch_on(self, name: str) -> None:
        """Switch the bridge of an idle axis on, and its watchdog; DeviceFault names the joint when it stays off."""
        amplifier = self._amplifiers[name]
        status = await amplifier.status()
        if status.was_reset:
            await amplifier.reset_events()
        # Noted first: a bridge whose switching on is not confirmed may be on, and has to be inhibited again.
        self.on |= {name}
        try:
            await amplifier.enable()
        except DeviceFault as error:
            raise DeviceFault(f"{name}: {error}", axis=name) from None
        await amplifier.watchdog(self._watchdog_ms)

    async def switch_off(self, names: Collection[str]) -> None:
        """Wait until the idle axes rest, then inhibit their bridges.

        Raises DeviceFault naming the joints that do not come to rest; their bridges stay on and brake them.
        """
        braked = False
        try:
            await self._stopping.stand(names)
        except DeviceFault as error:
            # At a closed switch the amplifier's directional inhibit keeps it from braking: its brake does not.
            log.warning("%s; braking", error)
            braked = True
            for name in names:
                await self._amplifiers[name].brake(True)
            await self._stopping.stand(names)
        for name in names:
            await self._amplifiers[name].watchdog(0)
            await self._amplifiers[name].inhibit()
            if braked:
                await self._amplifiers[name].brake(False)
            self.on -= {name}

    async def clear(self) -> None:
        """Reset the amplifiers' events, and end what a host that died has left of bridges and watchdogs."""
        left = []
        for name, amplifier in self._amplifiers.items():
            if name not in self.on:
                # Nobody feeds it any more: it would latch its fault again as soon as this host is gone.
                await amplifier.watchdog(0)
                if (await amplifier.status()).enabled:
                    left.append(name)
        if left:
            await self.switch_off(left)
        for amplifier in self._amplifiers.values():
            await amplifier.reset_events()
