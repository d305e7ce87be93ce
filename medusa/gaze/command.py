"""What a gaze behaviour receives, and what it decides: pure data, joint angles in radians."""

from collections.abc import Mapping
from dataclasses import dataclass, field

from medusa.kinematics import Joints, Tangents


@dataclass(frozen=True)
class Sighting:
    """Where the two eyes saw the target at one moment of exposure.

    stamp: that moment on the loop's clock [s]. joints: the joint angles then. left, right: the target's
    tangents from the optical axis (x right, y down), None where it was not seen. sigma: standard deviation of
    either tangent.
    """

    stamp: float
    joints: Joints
    left: Tangents | None
    right: Tangents | None
    sigma: float = 0.002

    @property
    def seen(self) -> bool:
        return self.left is not None or self.right is not None


@dataclass(frozen=True)
class Velocity:
    """A joint in integral velocity mode [rad/s]."""

    rate: float


@dataclass(frozen=True)
class Position:
    """A joint in position mode, stepped to an angle [rad]: a microsaccade."""

    angle: float


@dataclass(frozen=True)
class Saccade:
    """All joints to these angles as fast as their profiles allow, without visual feedback on the way."""

    target: Joints
    reason: str


@dataclass(frozen=True)
class Pursue:
    """Joints by axis name, each by velocity or to a position; `limited` names those held back by an end of travel."""

    joints: Mapping[str, Velocity | Position]
    limited: frozenset[str] = field(default_factory=frozenset)


@dataclass(frozen=True)
class Hold:
    """All joints at rest where they are, because of `reason`."""

    reason: str


Command = Saccade | Pursue | Hold


@dataclass(frozen=True)
class GazeLimits:
    """What the joints may do: angles [rad] between `low` and `high`, speeds [rad/s] and accelerations [rad/s²]."""

    low: Joints
    high: Joints
    speed: Joints
    acceleration: Joints

    def confine(self, target: Joints) -> tuple[Joints, frozenset[str]]:
        """The nearest angles within the limits, and the names of the axes at which they differ from the target."""
        confined = Joints(
            *(min(max(q, low), high) for q, low, high in zip(target, self.low, self.high, strict=True))
        )
        wanted, got = target.as_axes(), confined.as_axes()
        return confined, frozenset(name for name in wanted if wanted[name] != got[name])

    def duration(self, start: Joints, target: Joints) -> float:
        """How long a saccade takes [s]: the slowest joint's d/v + v/a, or 2√(d/a) when v is never reached."""
        times = []
        for here, there, v, a in zip(start, target, self.speed, self.acceleration, strict=True):
            distance = abs(there - here)
            times.append(distance / v + v / a if v * v / a < distance else 2 * (distance / a) ** 0.5)
        return max(times)
