"""One joint in radians: counts per radian, wiring sign, soft limits, the four control modes."""

import asyncio
import math
from collections.abc import Callable

from medusa.errors import CommandError, DeviceFault
from medusa.mc3000.board import Board, BoardEvent, Flags, Mode, Profile, profile_samples
from medusa.mc3000.board.profile import MAX_SPEED_COUNTS
from medusa.mc3000.config import AxisConfig
from medusa.mc3000.joint import VELOCITY_MODES, Joint

RAMP_LOOK_SECONDS = 0.01
RAMP_MARGIN_SECONDS = 0.5
"""On top of the ramp: the link's repeats, and in proportional velocity mode the coasting to rest."""


class Axis(Joint):
    """A joint of the head with its four control modes; units as in `Joint`."""

    def __init__(self, name: str, config: AxisConfig, board: Board) -> None:
        super().__init__(name, config, board)
        self._lock = asyncio.Lock()

    async def set_mode(self, mode: Mode, *, after_pending: bool = False) -> None:
        """Enter a control mode, or go idle, which `after_pending` lets the board's unanswered motions act first.

        Settings are written and read back before control is entered; between modes with different filters
        the axis passes through idle, since a filter meant for one mode may be unstable in another. A velocity
        is ended by its ramp first. Raises CommandError when a stop comes in between: it stays stopped.
        """
        if mode is Mode.IDLE:
            await self._go_idle(after_pending=after_pending)
            return
        if self.mode is not mode and self.may_ramp:
            await self.brake()
        async with self._lock:
            if self.mode is mode:
                return
            if self.mode is Mode.IDLE or self._filter_changes(mode):
                # An idle axis gets no MODE 0: it would set LIMIT_ENABLE again, which backing off needs clear.
                if self.mode is not Mode.IDLE:
                    await self._go_idle()
                stops = self._stops
                await self._write_settings(mode)
                if stops != self._stops:
                    raise CommandError(f"{self.name}: was stopped before it entered {mode.name.lower()} mode")
            self.stopping()
            await self.board.mode(self.channel, mode)
            self.mode = mode
            if mode is Mode.INTEGRAL_VELOCITY:
                # Entering it sets the chip's command velocity to 0.
                self._rate_register = 0

    async def brake(self) -> None:
        """End a velocity by the board's own ramp, which leaves the axis in position mode at rest.

        A mode change alone would take the present command position for the reference at once, and the position
        loop would brake as hard as it can. Raises DeviceFault when the ramp does not end in time.
        """
        loop = asyncio.get_running_loop()
        asked = loop.time()
        deadline = asked + self.ramp_seconds + RAMP_MARGIN_SECONDS
        await self.stop(after_pending=True)
        while True:
            snapshot, time = await self.board.timed_snapshot()
            reading = snapshot.axes[self.channel]
            self.take_snapshot(reading, time)
            if time > asked and reading.mode not in VELOCITY_MODES and not reading.flags & Flags.PROFILE:
                return
            if loop.time() > deadline:
                raise DeviceFault(f"{self.name}: its velocity did not end by its ramp", axis=self.name)
            await asyncio.sleep(RAMP_LOOK_SECONDS)

    async def _go_idle(self, *, after_pending: bool = False) -> None:
        self.stopping()
        await self.board.mode(self.channel, Mode.IDLE, after_pending=after_pending)
        self.mode = Mode.IDLE

    def _filter_changes(self, mode: Mode) -> bool:
        return self.config.filters.of(mode) != self.config.filters.of(self.mode)

    async def _write_settings(self, mode: Mode) -> None:
        filter_ = self.config.filters.of(mode).filter
        profile = self.profile()
        following = self.config.following_limit_counts
        if following < 1:
            raise CommandError(
                f"{self.name}: the following limit is {following} counts; at least 1 is needed"
            )
        await self.board.filter(self.channel, filter_)
        await self.board.profile(self.channel, profile)
        await self.board.following(self.channel, following)
        self._profile = profile
        settings = await self.board.settings(self.channel)
        written = (filter_, profile, following)
        held = (
            await self.board.read_filter(self.channel),
            await self.board.read_profile(self.channel),
            settings.following_limit,
        )
        if held != written:
            raise DeviceFault(
                f"{self.name}: wrote {written}, the board holds {held}; the axis stays idle", axis=self.name
            )

    async def step(self, angle: float) -> None:
        """Step the command position (rad) in position mode.

        Raises CommandError for a joint that is not homed, or a step that the following limit would trip.
        """
        self._require(Mode.POSITION)
        if not self.homed:
            raise CommandError(f"{self.name}: is not homed, so {math.degrees(angle):.2f}° means nothing")
        final = self.to_counts(angle)
        if self._command is None:
            self._command = await self.board.position(self.channel)
        step = abs(final - self._command)
        if step >= self.config.following_limit_counts:
            raise CommandError(
                f"{self.name}: a step of {step} counts is not under the following limit of"
                f" {self.config.following_limit_counts} counts; move there by a profile"
            )
        self._command = None
        await self.board.command(self.channel, final)
        self._command = final

    async def set_rate(self, rate: float) -> float:
        """Command a rate (rad/s) in the present velocity mode; the one taken after rounding to the chip's units.

        Nothing is sent when the chip holds it already. Raises CommandError for more than the chip can do.
        """
        self._require(*VELOCITY_MODES)
        mode = self.mode
        units = 16 if mode is Mode.PROPORTIONAL_VELOCITY else 1
        per_sample = rate * self.counts_per_radian * self.sample_period(mode)
        if not abs(per_sample) <= MAX_SPEED_COUNTS:
            raise CommandError(
                f"{self.name}: {math.degrees(rate):.1f}°/s is {per_sample:.1f} counts a sample;"
                f" the chip can do {MAX_SPEED_COUNTS}: a sample period of"
                f" {1e3 * self.sample_period(mode) * MAX_SPEED_COUNTS / abs(per_sample):.3f} ms would allow it"
            )
        value = round(per_sample * units)
        async with self._lock:
            if self._rate_register == value:
                return self.rate
            last = self.rate * self.counts_per_radian * self.sample_period(mode)
            self._rate_register = None
            if mode is Mode.INTEGRAL_VELOCITY:
                await self._write_profile(self.profile())
                if abs(value - round(last)) > MAX_SPEED_COUNTS:
                    # The chip takes steps of at most 127; its own ramp makes two of them one motion.
                    await self.board.velocity(self.channel, (value + round(last)) // 2)
            taken = value / (units * self.counts_per_radian * self.sample_period(mode))
            before = self.rate
            # Taken first: a command whose reply is lost may have acted and has to be watched.
            self._take_rate(taken)
            try:
                await self.board.velocity(self.channel, value)
            except CommandError:
                self._take_rate(before)
                raise
            self._rate_register = value
        return taken

    async def arm(self, final: int, profile: Profile, *, start: bool = False) -> None:
        """Arm (or start) a trapezoid to a count, whatever the soft limits."""
        async with self._lock:
            await self._write_profile(profile)
            self._command = None
            await self.board.move(self.channel, final, start=start)

    async def start(self, final: int, profile: Profile) -> float:
        """Start a trapezoid from the present command position to a count; how long it takes, s."""
        snapshot = await self.board.snapshot()
        distance = final - snapshot.axes[self.channel].command
        await self.arm(final, profile, start=True)
        samples = profile_samples(distance, profile)
        return math.ceil(samples) * self.sample_period(Mode.POSITION)

    async def _write_profile(self, profile: Profile) -> None:
        if self._profile != profile:
            self._profile = None
            await self.board.profile(self.channel, profile)
            self._profile = profile

    async def stop(self, *, after_pending: bool = False) -> None:
        """Send STOP to this axis alone; whoever needs it confirmed reads back.

        `after_pending`, as a step of a procedure, it lets the board's unanswered motions act first.
        """
        self.stopping()
        await self.board.stop(self.channel, after_pending=after_pending)

    def subscribe(self, callback: Callable[[BoardEvent], None]) -> Callable[[], None]:
        """Call back for each event of this axis; returns what ends the subscription."""

        def mine(event: BoardEvent) -> None:
            if event.axis == self.channel:
                callback(event)

        return self.board.subscribe(mine)
