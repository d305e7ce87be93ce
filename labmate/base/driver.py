"""What the author of a mobile base writes: a machine that is read, given a twist, and stopped. SI units.

A driver commands and reads. It confirms nothing, renews nothing and remembers no motion: `MobileBase`, written
once over any driver, does. What cannot be the same for all machines is data: `Capabilities`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Literal

from labmate.base.events import Bumper, Cause, Event
from labmate.base.reading import BaseReading
from labmate.odometry import Pose, WheelGeometry
from medusa.errors import CommandError

Kind = Literal["GO", "TURN"]


@dataclass(frozen=True, slots=True)
class Limits:
    """Greatest speed (m/s), turn rate (rad/s), acceleration (m/s²) and turn acceleration (rad/s²)."""

    speed: float
    turn_rate: float
    acceleration: float
    turn_acceleration: float

    @property
    def stop_seconds(self) -> float:
        """Longest ramp to a stop, s."""
        return max(self.speed / self.acceleration, self.turn_rate / self.turn_acceleration)


@dataclass(frozen=True, slots=True, kw_only=True)
class Capabilities:
    """What a machine can do and how well; the contract tests take their tolerances from it.

    `watchdog`: s without being fed after which it ramps to a stop by itself; infinity: never. `expires`: longest
    validity of one twist, s. `travels`: it drives GO and TURN by itself. `twist_step`: rounding of a twist, m/s and
    rad/s. `arrival`: how well GO (m) and TURN (rad) arrive. `lag`: s by which the body follows its speed: a stop at
    once runs on by speed × lag. `notice`: s after which what happens to it has been reported. `latch`: whether the
    machine itself remembers an emergency stop or only the host does. `bumpers`: sides with one.
    """

    watchdog: float
    expires: float
    travels: bool
    twist_step: tuple[float, float]
    arrival: tuple[float, float]
    lag: float
    notice: float
    latch: Literal["device", "host"]
    bumpers: Bumper


class BaseDriver(ABC):
    """One machine. Every coroutine may be cancelled; what it had sent may have acted.

    `limits` None: it can be read and stopped, not moved. `wheels`: the nominal geometry of a differential drive
    whose readings carry encoder counts, known once it is open; None elsewhere.
    """

    wheels: WheelGeometry | None = None
    facts: Mapping[str, Any] = {}
    """What the machine reports of itself, once it is open, for status."""

    def __init__(self, name: str, limits: Limits | None, can: Capabilities) -> None:
        self.name = name
        self.limits = limits
        self.can = can
        self._subscribers: list[Callable[[Event], None]] = []
        self.latched: set[Cause] = set()
        """What the host itself remembers, for a machine that does not (`can.latch`)."""

    @abstractmethod
    async def open(self) -> None:
        """Make the machine fit to move: at rest, limits and watchdog set and fed; again after a loss.

        Raises PortError (not there), NoReply, StopNotConfirmed (does not come to rest).
        """

    @abstractmethod
    async def close(self, *, at_rest: bool) -> None:
        """End the session; the watchdog is switched off only when the machine is known to be at rest."""

    @abstractmethod
    async def read(self) -> BaseReading:
        """Read the machine now; raises NoReply, PortError."""

    @abstractmethod
    async def twist(self, speed: float, turn_rate: float, valid: float) -> None:
        """Ramp to `speed` and `turn_rate`, and to a stop unless another twist comes within `valid` s.

        Raises CommandError (refused, nothing moved): latched, touched on that side, travelling.
        """

    async def travel(self, kind: Kind, amount: float) -> None:
        """Begin a GO (m) or TURN (rad) at the limits; its end is a `TravelEnded`. Raises CommandError."""
        raise CommandError(f"{self.name} drives no {kind} by itself")

    @abstractmethod
    async def stop(self) -> None:
        """Have the machine begin its ramp to a stop, whatever it does; repeated until taken. Raises NoReply."""

    @abstractmethod
    async def emergency_stop(self) -> None:
        """Stop the machine at once, and latch it. Raises NoReply, PortError."""

    @abstractmethod
    async def clear(self) -> None:
        """Release what is latched and whose cause is gone; what remains is read. Nothing moves."""

    async def set_pose(self, pose: Pose) -> None:
        """Make this the base's own pose, at rest; nothing to do for a base without one of its own."""
        _ = pose

    async def counters(self) -> Mapping[str, Any]:
        """Return what the machine has counted since its power-up, for status."""
        return {}

    def subscribe(self, callback: Callable[[Event], None]) -> Callable[[], None]:
        """Call back with each event; returns what ends it."""
        self._subscribers.append(callback)
        return lambda: self._subscribers.remove(callback)

    def publish(self, event: Event) -> None:
        """Hand an event to every subscriber."""
        for callback in list(self._subscribers):
            callback(event)
