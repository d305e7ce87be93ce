"""One axis of the board in time: its samples.

Samples fall on the multiples of 16 (T+1)/f since power-up, counted in ticks of 16/f = 8 µs. After a new T the old
period goes on until the first multiple of the new one that is not before the end of the running sample.
"""

from collections.abc import Callable

from sim_devices.hctl1100 import CLOCK_HZ, F0, F1, F3, F5, wrap24
from sim_devices.joint import Joint, UnconnectedAxis
from sim_devices.mc3000.axis_state import AxisState
from sim_devices.mc3000.reports import FOLLOWING_ERROR, POSITION, PROFILE_DONE, Recording, Report
from sim_devices.mc3000.servo_loop import Run, ordinary_samples

TICK_S = 16 / CLOCK_HZ
_ROUNDING_TICKS = 1e-6
STANDING_SAMPLES = 4


class Channel(AxisState):
    """An axis that takes its samples when it is advanced."""

    def __init__(self, number: int, joint: Joint | UnconnectedAxis, report: Callable[[Report], None]) -> None:
        self.recording: Recording | None = None
        self.careful = False
        """Take every sample by itself, also where many could be run at once (for tests)."""
        super().__init__(number, joint, report)

    def power_up(self, t: float) -> None:
        """Begin anew at t, with the sample timer of a reset."""
        super().power_up(t)
        self.profile_from = 0
        self.period = self.next_tick = self.chip.timer + 1
        self._new_period: tuple[int, int] | None = None
        self._aligned = True
        self.running: Run | None = None
        """A run of ordinary samples; chip and joint are out of date until it ends."""

    @property
    def active(self) -> bool:
        """Whether samples matter here: in control, moving, or recorded."""
        return (
            self.running is not None
            or self.chip.in_control
            or self.joint.moving
            or self.recording is not None
        )

    @property
    def start_tick(self) -> int:
        """The first sample on the period that the timer register asks for."""
        return self.next_tick if self._new_period is None else self._new_period[1]

    # Time

    def advance_to(self, t: float) -> None:
        """Take every sample up to t; chip and joint may be out of date until `settle`."""
        joint = self.joint
        while joint.due <= t:
            due = joint.due
            self._take_samples(due)
            self._bring(due)
            joint.on_due()
        self._take_samples(t)

    def _take_samples(self, t: float) -> None:
        joint = self.joint
        last = int((t - self.origin_time) / TICK_S + _ROUNDING_TICKS)
        if self.running is not None:
            self.next_tick = self.running.send(last)
            if self.next_tick > last:
                return
            self._end_run()
        while self.next_tick <= last:
            if not self.active and self._new_period is None:
                self._skip_to(last)
            elif not (self._aligned and joint.ordinary and self._run_to(last)):
                self._sample()

    def settle(self, t: float) -> None:
        """Bring shaft and counter to t, also between two samples, and chip and joint up to date."""
        self.advance_to(t)
        self._bring(t)

    def _bring(self, t: float) -> None:
        self._end_run()
        if t <= self.t:
            return
        self.t = t
        self.joint.advance_to(t)
        self._aligned = False
        self.take_counts()

    def _skip_to(self, last: int) -> None:
        """Nothing moves and nothing drives: the samples in between change nothing."""
        self.next_tick += ((last - self.next_tick) // self.period + 1) * self.period
        self.t = max(self.t, self.origin_time + (self.next_tick - self.period) * TICK_S)
        self.joint.advance_to(self.t)
        self.chip.previous = self.chip.actual
        self._aligned = True

    def _run_to(self, last: int) -> bool:
        """Begin a run of ordinary samples; return whether it reaches `last`."""
        chip, joint = self.chip, self.joint
        if (
            chip.flags & (F1 | F3)
            or self.encoder_lost
            or joint.index_armed
            or self.recording is not None
            or self._new_period is not None
            or self.next_tick < self.profile_from
            or self.careful
            or (self.stopping and not chip.flags & F0)
            or not isinstance(joint, Joint)
        ):
            return False
        self.running = ordinary_samples(
            chip,
            joint,
            self.next_tick,
            self.period,
            self.period * TICK_S,
            self.following_limit,
            self._encoder_shift,
        )
        if self.running is None:
            return False
        self.next_tick = self.running.send(last)
        if self.next_tick > last:
            return True
        self._end_run()
        return False

    def _end_run(self) -> None:
        if self.running is not None:
            for _ in self.running:
                pass
            self.running = None
            self.t = self.origin_time + (self.next_tick - self.period) * TICK_S
            self.joint.set_time(self.t)

    def _sample(self) -> None:
        tick = self.next_tick
        t = self.t = self.origin_time + tick * TICK_S
        joint, chip = self.joint, self.chip
        if self._aligned:
            joint.step_to(t, self.period * TICK_S)
        else:
            joint.advance_to(t)
        self._aligned = True
        self.take_counts()
        self.update_limit()
        if chip.in_control:
            self._control(tick)
        else:
            chip.previous = chip.actual
            joint.settle()
        if self.recording is not None:
            self._record(self.recording, t)
        self.next_tick = tick + self.period
        if self._new_period is not None:
            self._change_period()

    def _control(self, tick: int) -> None:
        chip = self.chip
        if chip.flags & F0 and tick < self.profile_from:
            chip.profile_sample -= 1
        ended = chip.update_command()
        limit = self.following_limit
        if limit and abs(wrap24(chip.command - chip.actual)) > limit:
            self.go_idle()
            self.report(FOLLOWING_ERROR)
            return
        chip.update_output()
        self.joint.drive(chip.motor_command)
        if ended:
            if not self.stopping:
                self.report(PROFILE_DONE)
            self.stopping = False
        elif self.stopping and chip.flags & F5 and chip.integral_velocity == 0:
            chip.flags &= ~F5
            self.mode = POSITION
            self.stopping = False
        elif self.stopping and chip.flags & F3:
            self._standing = self._standing + 1 if abs(chip.actual_velocity) <= 1 else 0
            if self._standing == STANDING_SAMPLES:
                self.go_idle()

    def _record(self, recording: Recording, t: float) -> None:
        recording.time.append(t)
        recording.command.append(self.chip.command)
        recording.actual.append(self.chip.actual)
        recording.motor_command.append(self.chip.motor_command)
        recording.angle.append(self.joint.angle)

    def set_timer(self, timer: int) -> None:
        """Take a new T; it takes hold as the module's text says."""
        self.chip.timer = timer
        period = timer + 1
        self._new_period = None
        if period != self.period:
            self._new_period = period, -(-self.next_tick // period) * period
            self._change_period()

    def _change_period(self) -> None:
        assert self._new_period is not None
        period, first = self._new_period
        if self.next_tick >= first:
            self.next_tick = first
            self.period = period
            self._new_period = None
            # The sample that runs now is not a whole new period long.
            self._aligned = False
