"""One joint in radians: counts per radian, wiring sign, soft limits, the four control modes."""

import asyncio
import math
from collections.abc import Callable
from dataclasses import dataclass

from medusa.errors import CommandError, DeviceFault
from medusa.mc3000.board import Board, BoardEvent, Flags, Mode, Profile, profile_samples
from medusa.mc3000.board.profile import MAX_SPEED_COUNTS
from medusa.mc3000.config import AxisConfig
from medusa.mc3000.joint import VELOCITY_MODES, Joint, Seen

FRESH_SECONDS = 0.1
"""A joint seen longer ago is looked at again before it is given a velocity."""
RAMP_LOOK_SECONDS = 0.01
RAMP_MARGIN_SECONDS = 0.5
"""On top of the ramp: the link's repeats, and in proportional velocity mode the coasting to rest."""


@dataclass(frozen=True)
class ArmedMove:
    """A trapezoid that waits for START: where to (counts), over what distance, and how long it takes."""

    axis: str
    final: int
    distance: int
    profile: Profile
    samples: float
    sample_period: float

    @property
    def seconds(self) -> float:
        """From the START's sample to the last command position, s."""
        return math.ceil(self.samples) * self.sample_period


class Axis(Joint):
    """A joint of the head with its four control modes; units as in `Joint`."""

    def __init__(self, name: str, config: AxisConfig, board: Board) -> None:
        super().__init__(name, config, board)
        self._lock = asyncio.Lock()

    async def position(self) -> float:
        """The joint's angle, rad; NaN while it is not homed."""
        return self.to_angle(await self.board.position(self.channel))

    async def set_mode(self, mode: Mode, *, orderly: bool = False) -> None:
        """Enter a control mode, or go idle; an orderly idle lets the board's unanswered motions act first.

        Settings are written and read back before control is entered; between modes with different filters
        the axis passes through idle, since a filter meant for one mode may be unstable in another. A velocity
        is ended by its ramp first. Raises CommandError when a stop comes in between: it stays stopped.
        """
        if mode is Mode.IDLE:
            await self._go_idle(orderly=orderly)
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
            self.note_stopping()
            await self.board.mode(self.channel, mode)
            self.mode = mode

    async def brake(self) -> None:
        """End a velocity by the board's own ramp, which leaves the axis in position mode at rest.

        A mode change alone would take the present command position for the reference at once, and the position
        loop would brake as hard as it can. Raises DeviceFault when the ramp does not end in time.
        """
        loop = asyncio.get_running_loop()
        asked = loop.time()
        deadline = asked + self.ramp_seconds + RAMP_MARGIN_SECONDS
        await self.stop(orderly=True)
        while True:
            snapshot, time = await self.board.timed_snapshot()
            seen = snapshot.axes[self.channel]
            self.note(seen, time)
            if time > asked and seen.mode not in VELOCITY_MODES and not seen.flags & Flags.PROFILE:
                return
            if loop.time() > deadline:
                raise DeviceFault(f"{self.name}: its velocity did not end by its ramp", axis=self.name)
            await asyncio.sleep(RAMP_LOOK_SECONDS)

    async def _go_idle(self, *, orderly: bool = False) -> None:
        self.note_stopping()
        await self.board.mode(self.channel, Mode.IDLE, orderly=orderly)
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

    async def command(self, angle: float) -> None:
        """Step the command position in position mode.

        Raises CommandError outside the soft limits or for a step that the following limit would trip.
        """
        self._require(Mode.POSITION)
        self._check_angle(angle)
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

    async def velocity(self, velocity: float) -> float:
        """Command a velocity (rad/s) in a velocity mode; the one taken after rounding to the chip's units.

        Raises CommandError for more than the configured speed, more than the chip can do, an axis that is not
        homed, or a joint that could not stop before its soft limit any more.
        """
        self._require(*VELOCITY_MODES)
        self._check_speed(velocity)
        mode = self.mode
        units = 16 if mode is Mode.PROPORTIONAL_VELOCITY else 1
        per_sample = velocity * self.counts_per_radian * self.sample_period(mode)
        if abs(per_sample) > MAX_SPEED_COUNTS:
            raise CommandError(
                f"{self.name}: {math.degrees(velocity):.1f}°/s is {per_sample:.1f} counts a sample;"
                f" the chip can do {MAX_SPEED_COUNTS}: a sample period of"
                f" {1e3 * self.sample_period(mode) * MAX_SPEED_COUNTS / abs(per_sample):.3f} ms would allow it"
            )
        await self._check_room(velocity)
        value = round(per_sample * units)
        async with self._lock:
            if mode is Mode.INTEGRAL_VELOCITY:
                await self._write_profile(self.profile())
                last = round(self.command_velocity * self.counts_per_radian * self.sample_period(mode))
                if abs(value - last) > MAX_SPEED_COUNTS:
                    # The chip takes steps of at most 127; its own ramp makes two of them one motion.
                    await self.board.velocity(self.channel, (value + last) // 2)
            taken = value / (units * self.counts_per_radian * self.sample_period(mode))
            before = self.command_velocity
            # Noted first: a command whose reply is lost may have acted and has to be watched.
            self._note_velocity(taken)
            try:
                await self.board.velocity(self.channel, value)
            except CommandError:
                self._note_velocity(before)
                raise
        return taken

    async def _check_room(self, velocity: float) -> None:
        if velocity == 0:
            return
        if not self.homed:
            raise CommandError(f"{self.name}: is not homed, so its soft limits cannot be kept")
        room = self.room(velocity, await self._lately_seen())
        if room <= 0:
            raise CommandError(
                f"{self.name}: a velocity of {math.degrees(velocity):.2f}°/s cannot stop any more before the"
                f" soft limit of {math.degrees(self.limit_ahead(velocity)):.2f}°"
            )

    async def _lately_seen(self) -> Seen:
        now = asyncio.get_running_loop().time()
        if self.seen is None or now - self.seen.time > FRESH_SECONDS:
            snapshot, time = await self.board.timed_snapshot()
            self.note(snapshot.axes[self.channel], time)
        if self.seen is None:
            raise DeviceFault(
                f"{self.name}: the board shows only what was before its last stop", axis=self.name
            )
        return self.seen

    async def hold(self) -> None:
        """Come to rest in the present velocity mode by its own ramp."""
        if self.mode in VELOCITY_MODES:
            await self.velocity(0.0)

    async def arm(
        self,
        angle: float,
        *,
        acceleration: float | None = None,
        max_speed: float | None = None,
        command_counts: int | None = None,
    ) -> ArmedMove:
        """Prepare a trapezoid to `angle` (rad) that begins with the board's START; position mode.

        `command_counts` is the present command position when the caller knows it. Raises CommandError outside
        the soft limits, or for a speed or an acceleration that the configuration or the chip does not allow.
        """
        profile = self.check_move(angle, acceleration, max_speed)
        return await self.arm_counts(self.to_counts(angle), profile, command_counts=command_counts)

    def check_move(self, angle: float, acceleration: float | None, max_speed: float | None) -> Profile:
        """The profile of a move to `angle` (rad); CommandError when it cannot be done. Sends nothing."""
        self._require(Mode.POSITION)
        self._check_angle(angle)
        return self.profile(acceleration, max_speed)

    async def arm_counts(
        self, final: int, profile: Profile, *, command_counts: int | None = None, start: bool = False
    ) -> ArmedMove:
        """Arm (or start) a trapezoid to a count, whatever the soft limits: for homing."""
        async with self._lock:
            if command_counts is None:
                snapshot = await self.board.snapshot()
                command_counts = snapshot.axes[self.channel].command
            await self._write_profile(profile)
            self._command = None
            await self.board.move(self.channel, final, start=start)
        distance = final - command_counts
        return ArmedMove(
            self.name,
            final,
            distance,
            profile,
            profile_samples(distance, profile),
            self.sample_period(Mode.POSITION),
        )

    async def _write_profile(self, profile: Profile) -> None:
        if self._profile != profile:
            self._profile = None
            await self.board.profile(self.channel, profile)
            self._profile = profile

    async def stop(self, *, orderly: bool = False) -> None:
        """Send STOP to this axis alone; whoever needs it confirmed reads back (`Head.stop` does).

        An orderly one, a step of a procedure, lets the board's unanswered motions act first.
        """
        self.note_stopping()
        await self.board.stop(self.channel, orderly=orderly)

    def subscribe(self, callback: Callable[[BoardEvent], None]) -> Callable[[], None]:
        """Call back for each event of this axis; returns what ends the subscription."""

        def mine(event: BoardEvent) -> None:
            if event.axis == self.channel:
                callback(event)

        return self.board.subscribe(mine)
