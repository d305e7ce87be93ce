"""One axis of the board as it stands: chip, joint, the board's own latches and settings, and what they report."""

from collections.abc import Callable

from sim_devices.hctl1100 import F0, Hctl1100, wrap24
from sim_devices.joint import Joint, UnconnectedAxis
from sim_devices.mc3000.reports import (
    AMPLIFIER_FAULT,
    HOME_FALLING,
    HOME_RISING,
    IDLE,
    INDEX,
    LATCH,
    LIMIT,
    NO_LATCH,
    STOP_INPUT,
    Report,
)


class AxisState:
    """Everything of an axis but its samples; `t` is where it stands in time."""

    def __init__(self, number: int, joint: Joint | UnconnectedAxis, report: Callable[[Report], None]) -> None:
        self.number = number
        self.joint = joint
        self.encoder_lost = False
        self.fault_input = False
        self.stop_input = False
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
        self._standing = 0
        self.joint.drive(0)
        self._set_latch(NO_LATCH)
        self.update_limit()
        self.set_stop_input(self.stop_input)
        self.set_fault_input(self.fault_input)

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
        self.stop_input = low
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
