"""One joint's scale and state: counts per radian, what the board last reported, what was last commanded."""

import asyncio
import math
from collections.abc import Callable

from medusa.errors import CommandError
from medusa.mc3000.board import AxisSnapshot, Board, Mode, Profile, make_profile
from medusa.mc3000.config import AxisConfig

VELOCITY_MODES = frozenset({Mode.PROPORTIONAL_VELOCITY, Mode.INTEGRAL_VELOCITY})

LINK_SECONDS = 0.5
"""A request that has to be repeated acts so much later at most."""


class Joint:
    """A joint without its commands. Angles are rad, zero straight ahead, known only when it is homed."""

    def __init__(self, name: str, config: AxisConfig, board: Board) -> None:
        self.name = name
        self.config = config
        self.board = board
        self.channel = config.channel
        self.mode = Mode.IDLE
        self.homed = False
        self.rate = 0.0
        """Commanded in a velocity mode, rad/s."""
        self.rate_changed: Callable[[], None] = lambda: None
        self._ramps_until = -math.inf
        self._stopped_at = -math.inf
        self._stops = 0
        self._command: int | None = None
        self._profile: Profile | None = None
        self._rate_register: int | None = None

    @property
    def counts_per_radian(self) -> float:
        """Signed scale: counts = counts_per_radian × angle."""
        return self.config.sign * self.config.counts_per_radian

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

        Raises CommandError for what the chip does not allow.
        """
        acceleration = self.config.acceleration if acceleration is None else acceleration
        max_speed = self.config.max_speed if max_speed is None else max_speed
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
        """True while a rate other than zero is commanded, or its ramp to zero may not have ended yet."""
        if self.mode not in VELOCITY_MODES:
            return False
        return self.rate != 0 or asyncio.get_running_loop().time() < self._ramps_until

    def take_snapshot(self, snapshot: AxisSnapshot, time: float) -> None:
        """Take in what the board showed at `time` (loop, s); stops and faults change the mode there.

        A snapshot from before the last change of mode, which a repeated reply can bring, is ignored.
        """
        if time > self._stopped_at and snapshot.mode is not self.mode:
            self.mode = snapshot.mode
            self._forget_motion()

    def stopping(self) -> None:
        """A stop or a change of mode is on its way: what was reported or begun before it is invalid."""
        self._stops += 1
        self._stopped_at = asyncio.get_running_loop().time()
        self._forget_motion()

    def lost(self) -> None:
        """The board restarted or was lost: what was written to it holds no more."""
        self._profile = None
        self.mode = Mode.IDLE
        self._forget_motion()

    def _take_rate(self, rate: float) -> None:
        """A rate (rad/s) is on its way: the joint may move, and ramp down for a while after a zero."""
        if rate == 0 and self.rate != 0:
            self._ramps_until = asyncio.get_running_loop().time() + self.ramp_seconds + LINK_SECONDS
        self.rate = rate
        self.rate_changed()

    def _forget_motion(self) -> None:
        self._command = None
        self._rate_register = None
        self.rate = 0.0
        self.rate_changed()

    def _require(self, *modes: Mode) -> None:
        if self.mode is Mode.IDLE:
            raise CommandError(f"{self.name}: is idle; enable it first")
        if self.mode not in modes:
            wanted = " or ".join(mode.name.lower().replace("_", " ") for mode in modes)
            raise CommandError(f"{self.name}: is in mode {self.mode.name.lower()}, {wanted} is needed")
