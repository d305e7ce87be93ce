"""What a joint is and where it was seen: scale, sign, limits, and the room before them."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.mc3000.board import AxisSnapshot, Board, Mode, Profile, make_profile
from medusa.mc3000.config import AxisConfig

VELOCITY_MODES = frozenset({Mode.PROPORTIONAL_VELOCITY, Mode.INTEGRAL_VELOCITY})

LINK_SECONDS = 0.5
"""A request that has to be repeated acts so much later at most."""
SUPERVISION_SECONDS = 0.04
"""Between the instant that a snapshot shows and the stop that follows from it: two requests and a timer."""


@dataclass(frozen=True)
class Seen:
    """Where a joint was seen last: loop time (s), actual and command position (counts)."""

    time: float
    actual: int
    command: int


class Joint:
    """A joint without its commands. Angles are rad, zero straight ahead, known only when it is homed."""

    def __init__(self, name: str, config: AxisConfig, board: Board) -> None:
        self.name = name
        self.config = config
        self.board = board
        self.channel = config.channel
        self.mode = Mode.IDLE
        self.homed = False
        self.command_velocity = 0.0
        self._moving_until = -math.inf
        self.velocity_changed: Callable[[], None] = lambda: None
        self.seen: Seen | None = None
        self._stopped_at = -math.inf
        self._stops = 0
        self._command: int | None = None
        self._profile: Profile | None = None

    @property
    def counts_per_radian(self) -> float:
        """Signed scale: counts = counts_per_radian × angle."""
        return self.config.sign * self.config.counts_per_radian

    @property
    def limits(self) -> tuple[float, float]:
        """Soft limits, rad."""
        return self.config.soft_limits

    def to_counts(self, angle: float) -> int:
        """The nearest count to an angle (rad)."""
        return round(angle * self.counts_per_radian)

    def to_angle(self, counts: float) -> float:
        """The angle of a count, rad; NaN while the joint is not homed: the counts mean nothing then."""
        return counts / self.counts_per_radian if self.homed else math.nan

    def sample_period(self, mode: Mode) -> float:
        """Sample period of a control mode's filter, s."""
        return self.config.filters.of(mode).filter.sample_period(self.board.clock_hz)

    def profile(self, acceleration: float | None = None, max_speed: float | None = None) -> Profile:
        """PROFILE for an acceleration (rad/s²) and a speed (rad/s); the configuration's when not given.

        Raises CommandError for what the configuration or the chip does not allow.
        """
        acceleration = self.config.acceleration if acceleration is None else acceleration
        max_speed = self.config.max_speed if max_speed is None else max_speed
        self._check_speed(max_speed)
        if not 0 < acceleration <= self.config.acceleration * (1 + 1e-9):
            raise CommandError(
                f"{self.name}: an acceleration of {math.degrees(acceleration):.1f}°/s² is not in"
                f" (0, {self.config.acceleration_deg_s2:g}]°/s²"
            )
        scale = self.config.counts_per_radian
        try:
            return make_profile(
                acceleration * scale,
                max_speed * scale,
                self.config.filters.position.filter,
                self.board.clock_hz,
            )
        except CommandError as error:
            raise CommandError(f"{self.name}: {error}") from None

    @property
    def ramp_seconds(self) -> float:
        """The longest ramp to rest, from the greatest speed, s."""
        return self.config.max_speed / self.config.acceleration

    @property
    def may_ramp(self) -> bool:
        """True while a velocity other than zero is commanded, or its ramp to zero may not have ended yet."""
        if self.mode not in VELOCITY_MODES:
            return False
        return self.command_velocity != 0 or asyncio.get_running_loop().time() < self._moving_until

    def limit_ahead(self, velocity: float) -> float:
        """The soft limit (rad) toward which a velocity goes."""
        return self.limits[1] if velocity > 0 else self.limits[0]

    def room(self, velocity: float, seen: Seen) -> float:
        """Angle (rad) left before a joint has to begin to stop, so as to stand before its soft limit.

        The stop takes v²/2a, and v times the supervision's delay passes before it begins. In the integral
        velocity mode the command position runs ahead, so the one nearer to the limit counts; since the joint
        was seen it may have gone on at the greater of the old and the new velocity.
        """
        toward = 1 if velocity > 0 else -1
        angles = [self.to_angle(seen.actual)]
        if self.mode is Mode.INTEGRAL_VELOCITY:
            angles.append(self.to_angle(seen.command))
        ahead = min((self.limit_ahead(velocity) - angle) * toward for angle in angles)
        speed = max(abs(velocity), toward * self.command_velocity)
        age = max(0.0, asyncio.get_running_loop().time() - seen.time)
        return ahead - speed**2 / (2 * self.config.acceleration) - speed * (age + SUPERVISION_SECONDS)

    def note(self, seen: AxisSnapshot, time: float) -> None:
        """Take in what the board showed at `time` (loop, s); stops and faults change the mode there.

        A snapshot from before the last change of mode, which a repeated reply can bring, says nothing.
        """
        if time <= self._stopped_at:
            return
        self.seen = Seen(time, seen.actual, seen.command)
        if seen.mode is not self.mode:
            self.mode = seen.mode
            self._forget_motion()

    def note_stopping(self) -> None:
        """A stop or a change of mode is on its way: what was shown or begun before it is void."""
        self._stops += 1
        self._stopped_at = asyncio.get_running_loop().time()
        self._forget_motion()

    def note_lost(self) -> None:
        """The board restarted or was lost: what was written to it holds no more."""
        self._profile = None
        self.mode = Mode.IDLE
        self.seen = None
        self._forget_motion()

    def _note_velocity(self, velocity: float) -> None:
        """A velocity (rad/s) is on its way: the joint may move, and ramp down for a while after a zero."""
        if velocity == 0 and self.command_velocity != 0:
            self._moving_until = asyncio.get_running_loop().time() + self.ramp_seconds + LINK_SECONDS
        self.command_velocity = velocity
        self.velocity_changed()

    def _forget_motion(self) -> None:
        self._command = None
        self.command_velocity = 0.0
        self.velocity_changed()

    def _require(self, *modes: Mode) -> None:
        if self.mode is Mode.IDLE:
            raise CommandError(f"{self.name}: is idle; enable it first")
        if self.mode not in modes:
            wanted = " or ".join(mode.name.lower().replace("_", " ") for mode in modes)
            raise CommandError(f"{self.name}: is in mode {self.mode.name.lower()}, {wanted} is needed")

    def _check_angle(self, angle: float) -> None:
        low, high = self.limits
        if not self.homed:
            raise CommandError(f"{self.name}: is not homed, so {math.degrees(angle):.2f}° means nothing")
        if not low <= angle <= high:
            raise CommandError(
                f"{self.name}: {math.degrees(angle):.2f}° is outside the soft limits"
                f" {math.degrees(low):.2f}..{math.degrees(high):.2f}°"
            )

    def _check_speed(self, speed: float) -> None:
        if not abs(speed) <= self.config.max_speed * (1 + 1e-9):
            raise CommandError(
                f"{self.name}: a speed of {math.degrees(speed):.1f}°/s is over the limit of"
                f" {self.config.max_speed_deg_s:g}°/s"
            )
