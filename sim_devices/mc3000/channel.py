"""One axis of the board in time: its samples, its latches, and what they report.

Samples fall on the multiples of 16 (T+1)/f since power-up, counted in ticks of 16/f = 8 µs. After a new T the old
period goes on until the first multiple of the new one that is not before the end of the running sample.
"""

from collections.abc import Callable

from sim_devices.hctl1100 import CLOCK_HZ, F0, F1, F3, F5, Hctl1100, wrap24
from sim_devices.joint import EmptySocket, Joint
from sim_devices.mc3000.reports import (
    AMPLIFIER_FAULT,
    FOLLOWING_ERROR,
    HOME_FALLING,
    HOME_RISING,
    IDLE,
    INDEX,
    LATCH,
    LIMIT,
    NO_LATCH,
    POSITION,
    PROFILE_DONE,
    STOP_INPUT,
    Recording,
    Report,
)
from sim_devices.mc3000.servo_loop import Run, ordinary_samples

TICK_S = 16 / CLOCK_HZ
TICK_US = 8
_ROUNDING_TICKS = 1e-6
STANDING_SAMPLES = 4


class Channel:
    """Chip, joint and the board's own state of one axis."""

    def __init__(self, number: int, joint: Joint | EmptySocket, report: Callable[[Report], None]) -> None:
        self.number = number
        self.joint = joint
        self.recording: Recording | None = None
        self.encoder_lost = False
        self.fault_input = False
        self.careful = False
        """Take every sample by itself, also where many could be run at once (for tests)."""
        self._report = report
        joint.on_home = self._home_edge
        joint.on_index = self._index_edge
        self.power_up(0.0)

    def power_up(self, t: float) -> None:
        """Begin anew at t: every setting is lost; the joint stands or moves on as it is."""
        self.joint.advance_to(t)
        self.origin_time = self.t = t
        self.chip = Hctl1100()
        self.chip.count = self.chip.origin = self.joint.count
        self._encoder_shift = 0
        self.mode = IDLE
        self.following_limit = 0
        self.limit_enable = True
        self.armed: int | None = None
        self.latch_source = NO_LATCH
        self.caught: tuple[int, int] | None = None
        self.filter_registers: set[int] = set()
        self.fault_latched = False
        self.watchdog_expired = False
        self.emergency = False
        self.stopping = False
        self.profile_from = 0
        self._standing = 0
        self.period = self.next_tick = self.chip.timer + 1
        self._new_period: tuple[int, int] | None = None
        self._aligned = True
        self.running: Run | None = None
        """A run of ordinary samples; chip and joint are out of date until it ends."""
        self.joint.drive(0)
        self._set_latch(NO_LATCH)
        self.update_limit()
        self.set_fault_input(self.fault_input)

    # State that others read

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
    def profile_running(self) -> bool:
        """Whether a profile runs: F0 in control."""
        return bool(self.chip.flags & F0) and self.chip.in_control

    @property
    def filter_chosen(self) -> bool:
        """Whether a host has written 20H–22H and 0FH since the last reset."""
        return self.filter_registers >= {0x20, 0x21, 0x22, 0x0F}

    @property
    def inputs(self) -> int:
        """The byte of INPUTS."""
        joint = self.joint
        bits = (
            joint.negative_closed,
            joint.positive_closed,
            joint.sensor,
            self.fault_input,
            self.chip.limit_latched,
            self.emergency,
            self.fault_latched,
            self.watchdog_expired,
        )
        return sum(1 << bit for bit, on in enumerate(bits) if on)

    def microseconds(self, t: float) -> int:
        """Return µs since power-up, not wrapped."""
        return round((t - self.origin_time) * 1e6)

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

    # Encoder and inputs

    def take_counts(self) -> None:
        """Read the encoder, unless it is lost."""
        if not self.encoder_lost:
            self.chip.count = self.joint.count + self._encoder_shift

    def set_encoder_lost(self, lost: bool) -> None:
        """Pull or plug the encoder at the board; the counts in between are lost."""
        self.take_counts()
        self.encoder_lost = lost
        self._encoder_shift = self.chip.count - self.joint.count

    def update_limit(self) -> None:
        """Look at the limit switches: while enabled they drive the chip's LIMIT input."""
        joint = self.joint
        low = self.limit_enable and (joint.positive_closed or joint.negative_closed)
        if low != self.chip.limit_pin_low and self.chip.set_limit_pin(low):
            self._become_idle()
            self.report(LIMIT, detail=True)

    def set_fault_input(self, on: bool) -> None:
        """Move the amplifier's fault input; it latches, and the axis goes idle."""
        self.fault_input = on
        if on and not self.fault_latched:
            self.fault_latched = True
            self.go_idle()
            self.report(AMPLIFIER_FAULT, detail=True)

    def set_stop_input(self, low: bool) -> None:
        """Move the chip's STOP pin."""
        if self.chip.set_stop_pin(low):
            self.report(STOP_INPUT)

    def go_idle(self) -> None:
        """Go idle, by whatever cause and also from idle."""
        self._become_idle()
        self.update_limit()

    def _become_idle(self) -> None:
        self.chip.go_idle()
        self.mode = IDLE
        self.joint.drive(0)
        self.armed = None
        self.stopping = False
        self.limit_enable = True
        self._set_latch(NO_LATCH)

    def begin_stop(self) -> None:
        """Count standing samples from here on, or let the ramp end."""
        self.stopping = True
        self._standing = 0

    def report(self, operation: int, *, detail: bool = False) -> None:
        """Report an event of now; its detail is the inputs or 0."""
        inputs = self.inputs if detail else 0
        self._report(Report(self.microseconds(self.t), operation, self.number, self.chip.actual, inputs))

    # The board's latch

    def _set_latch(self, source: int) -> None:
        self.latch_source = source
        self.joint.index_armed = source == INDEX

    def arm_latch(self, source: int) -> None:
        """LATCH: forget what was caught, and arm."""
        self.caught = None
        self._set_latch(source)

    def _home_edge(self, level: bool, count: int, t: float) -> None:
        if self.latch_source == (HOME_RISING if level else HOME_FALLING):
            self._catch(count, t)

    def _index_edge(self, count: int, t: float) -> None:
        if self.latch_source == INDEX and not self.encoder_lost:
            self._catch(count, t)

    def _catch(self, count: int, t: float) -> None:
        chip = self.chip
        counted = chip.count if self.encoder_lost else count + self._encoder_shift
        self.caught = wrap24(counted - chip.origin), self.microseconds(t)
        self._set_latch(NO_LATCH)
        self._report(Report(self.caught[1], LATCH, self.number, self.caught[0], 0))
