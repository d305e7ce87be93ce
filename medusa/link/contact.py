"""Whether a device's watchdog may have expired: looked at before anything leaves for the device.

Who feeds a watchdog knows when it last did: the device was fed at or after the first sending of the last request
that it answered. Whatever leaves later than the watchdog's timeout after that finds a machine that has stopped by
itself, and feeds it again: nothing that was commanded before may move it now. Host time counts suspension too.
"""

import time
from collections.abc import Callable
from math import inf
from typing import Final

from medusa.errors import HostGap

# A frame takes this long to its device: what leaves just in time would arrive too late.
_ON_THE_WAY_S: Final = 0.01
# Reading two clocks one after the other is not exact; below this the host was not suspended.
_SHORTEST_SUSPENSION_S: Final = 0.01


def seconds_suspended() -> float:
    """Return for how long this host was suspended since it started (CLOCK_BOOTTIME − CLOCK_MONOTONIC), s."""
    # In this order a pause between the two readings makes the difference too small, never too large.
    boot_time = time.clock_gettime(time.CLOCK_BOOTTIME)
    return boot_time - time.clock_gettime(time.CLOCK_MONOTONIC)


class Contact:
    """When one device was last fed; `gap` is set from the moment in which that was too long ago to the next HELLO.

    `suspended`: seconds for which the host was suspended, from any origin.
    """

    def __init__(self, device: str, suspended: Callable[[], float] = seconds_suspended) -> None:
        self.device = device
        self.gap: HostGap | None = None
        self._suspended = suspended
        self._origin = max(suspended() for _ in range(3))
        self._away = 0.0
        self._timeout = inf
        self._fed = -inf

    def time(self, now: float) -> float:
        """Return the host's own time, s: the loop's, and what the host was suspended since this contact began."""
        away = self._suspended() - self._origin
        if away > self._away + _SHORTEST_SUSPENSION_S:
            self._away = away
        return now + self._away

    def refusal(self) -> HostGap | None:
        """Return the error for a motion that is asked for after a gap and before a new session; None without."""
        return None if self.gap is None else HostGap(self.device, self.gap.gap, self.gap.watchdog)

    def arm(self, timeout: float, sent: float) -> None:
        """Take in that the device's watchdog is on (s) and was fed by a request first sent at this host time."""
        self._timeout = timeout
        self._fed = sent

    def disarm(self) -> None:
        """Take in that the device's watchdog is off."""
        self._timeout = inf

    def reset(self) -> None:
        """Take in a new session: the machine is at rest, its watchdog off."""
        self.disarm()
        self.gap = None

    def answered(self, sent: float) -> None:
        """Take in the answer to a request first sent at this host time."""
        self._fed = max(self._fed, sent)

    def unfed(self, now: float) -> float:
        """Return for how long the device has not been fed, s; infinity before its watchdog was first on."""
        return self.time(now) - self._fed

    def look(self, now: float) -> HostGap | None:
        """Return the gap at the first look that finds one, else None."""
        if self._timeout == inf or self.gap is not None:
            return None
        unfed = self.unfed(now)
        if unfed <= self._timeout - _ON_THE_WAY_S:
            return None
        self.gap = HostGap(self.device, unfed, self._timeout)
        return self.gap
