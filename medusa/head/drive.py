"""What moves joints: the interface that a machine's author writes, in SI units and nothing of the machine's own.

A drive knows its machine. It reads, plans, moves, stops and reports faults; it judges nothing that is the same
for every machine: soft limits, the confirmation of a stop, cancellation, one joint's fault that stops all. Those
are the joint group's, written once over any drive (`joint_group`). `tests/contract` holds every drive to the same
promises, with the tolerances that its capabilities name.
"""

import logging
from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, Protocol

from medusa.head.faults import Cause, Fault

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class JointTraits:
    """What one joint may do and how finely: rad, rad/s, rad/s².

    low, high: soft limits. speed, acceleration: greatest of profiles and rates. resolution: of a reading.
    rate_step: between two rates that differ. settle: greatest error of a settled joint. largest_step: that `step`
    takes. park: angle of the parked head.
    """

    low: float
    high: float
    speed: float
    acceleration: float
    resolution: float
    rate_step: float
    settle: float
    largest_step: float
    park: float

    @property
    def ramp_seconds(self) -> float:
        """From the greatest speed to rest, s."""
        return self.speed / self.acceleration


@dataclass(frozen=True)
class Capabilities:
    """What cannot be the same for all machines. Times in s.

    start_skew, end_skew: between the first and the last joint of a move that begins, or ends, together.
    stamp_error: of a reading's stamps. notice: from a fault to its report. watchdog: without a request for so long
    the machine stops by itself; None: it has none. keeps_limits: the machine keeps the soft limits without a host.
    retargets: a move may begin while a rate is in force. emergency: what an emergency stop leaves, limp or holding
    joints. latch: who remembers an emergency stop.
    """

    start_skew: float
    end_skew: float
    stamp_error: float
    notice: float
    watchdog: float | None
    keeps_limits: bool
    retargets: bool
    homing: Literal["search", "absolute"]
    emergency: Literal["limp", "holds"]
    latch: Literal["device", "host"]


@dataclass(frozen=True)
class JointState:
    """One joint at `time` on the loop's clock, s. Angles rad, zero straight ahead, positive as in the conventions.

    angle, commanded: NaN until homed. raw: always finite, of an unknown zero until homed; rest is judged by it.
    rate: commanded, rad/s. moving: something commands motion, a profile or a rate whatever its value. enabled: under
    control, or driven. latched: what has to be cleared before it moves. device: the drive's own, for `details`.
    """

    time: float
    angle: float
    raw: float
    commanded: float
    rate: float
    moving: bool
    enabled: bool
    homed: bool
    latched: frozenset[Cause] = frozenset()
    device: Any = field(default=None, repr=False)


@dataclass(frozen=True)
class Reading:
    """Joints by name; `time` is that of the oldest of them, which differ by some ms at most."""

    time: float
    joints: dict[str, JointState]


@dataclass(frozen=True)
class Speeds:
    """Acceleration (rad/s²) and greatest speed (rad/s) of one joint's move; the traits' when None."""

    acceleration: float | None = None
    max_speed: float | None = None


@dataclass(frozen=True)
class MovePlan:
    """A move before it begins, as the machine rounds it; rad, rad/s, s from the start.

    finals: where it ends. seconds: when the command gets there. peak_speeds: reached on the way. early: joints too
    near to end together with the others. details: the drive's own figures, for documents. device: for the drive.
    """

    targets: dict[str, float]
    finals: dict[str, float]
    seconds: dict[str, float]
    peak_speeds: dict[str, float]
    early: tuple[str, ...] = ()
    details: Mapping[str, Mapping[str, Any]] = field(default_factory=dict)
    device: Any = field(default=None, repr=False)

    @property
    def duration(self) -> float:
        """Until the last command of the last joint, s."""
        return max(self.seconds.values(), default=0.0)


@dataclass(frozen=True)
class MoveEnds:
    """When each joint's command began and ended, on the loop's clock, s; NaN or missing where nobody knows.

    repeated: devices whose start had to be repeated, so that they began late.
    """

    started: dict[str, float]
    ended: dict[str, float]
    repeated: tuple[str, ...] = ()


@dataclass(frozen=True)
class Homed:
    """One joint whose angle has become known: where it is now, rad, and how long that took, s."""

    axis: str
    angle: float
    seconds: float

    @property
    def details(self) -> dict[str, Any]:
        """What only this machine has, for documents."""
        return {}


class Mover(Protocol):
    """What homing needs of the joint group: a confirmed move, and the machine at rest after a fault."""

    async def move_to(self, targets: Mapping[str, float]) -> Reading: ...

    async def disable(self, names: Collection[str]) -> None: ...

    async def stopped_by_fault(self) -> str: ...


Listener = Callable[[Fault], None]


class Drive(ABC):
    """One machine's joints. Every method that talks to it raises what its line raises (MedusaError).

    `units`: joints that one device carries, reads and stops together. Nothing moves by `open`, `read`, `enable`,
    `arm`, `clear` or `close`.
    """

    traits: Mapping[str, JointTraits]
    can: Capabilities
    units: tuple[tuple[str, ...], ...]

    def __init__(self) -> None:
        self._listeners: list[Listener] = []

    @property
    @abstractmethod
    def enabled(self) -> frozenset[str]:
        """Joints that this host has enabled."""

    @abstractmethod
    async def open(self) -> None:
        """Connect; the machine is at rest afterwards."""

    @abstractmethod
    async def close(self) -> None:
        """Let go; the group has stopped and disabled before, as far as that went."""

    @abstractmethod
    async def read(self, names: Collection[str] | None = None) -> Reading:
        """At least the named joints (default: all), each with the instant at which it was so."""

    @abstractmethod
    async def enable(self, names: Collection[str]) -> None:
        """Take joints under control where they are. CommandError while something is latched, DeviceFault by name."""

    @abstractmethod
    async def disable(self, names: Collection[str]) -> None:
        """End rates by their ramps, wait for rest and let go; the watchdogs end with the last joint.

        DeviceFault names the joints that do not come to rest: they are not let go.
        """

    @abstractmethod
    async def home(self, names: Collection[str], mover: Mover) -> Mapping[str, Homed]:
        """Make the angles of joints known, in the machine's own way."""

    @abstractmethod
    def plan(
        self,
        reading: Reading,
        targets: Mapping[str, float],
        speeds: Mapping[str, Speeds],
        *,
        together: bool = False,
    ) -> MovePlan:
        """Profiles from the commanded positions of `reading`; `together`: stretched to end at once. Sends nothing.

        CommandError for what the machine cannot do; soft limits and speeds have been checked.
        """

    @abstractmethod
    async def arm(self, plan: MovePlan) -> None:
        """Prepare a move; nothing begins. CommandError, and then no joint of it is armed."""

    @abstractmethod
    async def run(self, plan: MovePlan) -> MoveEnds:
        """Begin an armed move and wait until every joint's command has ended; cancelling it stops nothing.

        DeviceFault naming the joints whose command does not end in time.
        """

    @abstractmethod
    async def set_rates(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Command rates (rad/s); those taken after rounding. One that is in force already may send nothing.

        CommandError for a joint that is idle, or a rate that the machine cannot do.
        """

    @abstractmethod
    async def step(self, angles: Mapping[str, float]) -> None:
        """Step the commanded positions (rad), as a microsaccade does; a rate ends by its ramp first.

        CommandError for a joint that is idle or not homed, or a step over its largest.
        """

    @abstractmethod
    async def stop(self, names: Collection[str]) -> None:
        """Bring joints to rest by their acceleration and hold them there; the caller reads back.

        Accepted in every state. What was armed or begun before is over.
        """

    @abstractmethod
    async def emergency_stop(self) -> None:
        """Stop everything at once and latch it; the caller reads back."""

    @abstractmethod
    async def clear(self) -> None:
        """Release what is latched and whose cause is gone; moves nothing."""

    async def after_stop(self, fault: Fault) -> str:
        """Called when all joints have been stopped for a fault; what else there is to report of it."""
        return ""

    def details(self, reading: Reading) -> dict[str, dict[str, Any]]:
        """By joint what only this machine has: for status and documents."""
        return {name: {} for name in reading.joints}

    def subscribe(self, listener: Listener) -> Callable[[], None]:
        """Call back for each fault; returns what ends the subscription."""
        self._listeners.append(listener)
        return lambda: self._listeners.remove(listener)

    def publish(self, fault: Fault) -> None:
        """Report a fault; an exception in a listener is logged and does not keep it from the others."""
        log.warning("%s: %s", ", ".join(fault.joints), fault.reason)
        for listener in list(self._listeners):
            try:
                listener(fault)
            except Exception:
                log.exception("a fault's listener failed")
