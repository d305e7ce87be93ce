"""The HCTL-1100 axis-control chip at register level: registers, flags, latches, filter, its three motions.

The chip alone does what its page says; which of it a host may ask for at which time is the board's matter.
Whoever owns it feeds `count` (the encoder's) and calls `update_command` and `update_output` at every sample.
"""

from sim_devices.digital_filter import DigitalFilter
from sim_devices.profile import Trapezoid

CLOCK_HZ = 2_000_000
F0, F1, F2, F3, F4, F5 = (1 << bit for bit in range(6))
_HOST_FLAGS = F0 | F2 | F3 | F4 | F5

READ_ONLY = frozenset({0x12, 0x14, 0x34, 0x35})
WRITE_ONLY = frozenset({0x05, 0x15, 0x16, 0x17})
_READ_WRITE = frozenset(
    {0x00, 0x07, 0x08, 0x09, 0x0C, 0x0D, 0x0E, 0x0F, 0x13, *range(0x18, 0x20), 0x20, 0x21, 0x22}
    | {0x23, 0x24, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B, 0x3C}
)
READABLE = _READ_WRITE | READ_ONLY
WRITABLE = _READ_WRITE | WRITE_ONLY


def wrap24(value: int) -> int:
    """Bring a number into 24-bit two's complement."""
    return (value + 0x800000 & 0xFFFFFF) - 0x800000


def signed(value: int, bits: int) -> int:
    """Read an unsigned number as two's complement."""
    return value - (1 << bits) if value >> bits - 1 else value


class Hctl1100:
    """One chip. `command`, `actual`: 24-bit counts; `motor_command`: −128..127, as the DAC puts it out."""

    def __init__(self) -> None:
        self.count = 0
        self.stop_pin_low = False
        self.limit_pin_low = False
        self.stop_latched = False
        self.limit_latched = False
        self.filter = DigitalFilter()
        self.reset()

    def reset(self) -> None:
        """Soft reset: A, B, K, T to their values, everything else zero, then Init/Idle."""
        self.flags = 0
        self.status_nibble = 0
        self.filter.load(0xE5, 0x40, 0x40)
        self.timer = 0x40
        self.command = 0
        self.origin = self.count
        self.storage = [0] * 8
        self.velocity_command = 0
        self.acceleration = 0
        self.maximum_velocity = 0
        self.final_bytes = bytearray(3)
        self.actual_velocity = 0
        self.integral_command = 0
        self.integral_velocity = 0
        self.integral_position = 0
        self.velocity_held = False
        self.profile: Trapezoid | None = None
        self.profile_sample = 0
        self.previous = 0
        self._command_buffer = [0, 0]
        self._preset_buffer = [0, 0]
        self._position_latch = 0
        self.release_latches()
        self.go_idle()

    @property
    def actual(self) -> int:
        """The position counter."""
        return wrap24(self.count - self.origin)

    @property
    def final(self) -> int:
        """Registers 29H–2BH as one number."""
        return signed(int.from_bytes(self.final_bytes, "little"), 24)

    @property
    def in_control(self) -> bool:
        """Whether the chip is out of Init/Idle."""
        return not self.flags & F1

    @property
    def status(self) -> int:
        """Register 07H: STOP and LIMIT stand at 0 when triggered."""
        shown = self.status_nibble | (0x10 if self.flags & F0 else 0) | (0x20 if self.flags & F1 else 0)
        return shown | (0 if self.stop_latched else 0x40) | (0 if self.limit_latched else 0x80)

    def go_idle(self) -> None:
        """Init/Idle: motor command and PWM zero, old filter samples cleared; the flags of the host stay."""
        self.flags |= F1
        self.motor_command = 0
        self.pwm = 0
        self.filter.clear()
        self.profile = None

    def enter_control(self) -> None:
        """Program counter 03H, from Init/Idle only; LIMIT low sends it straight back."""
        if self.flags & F1 and not self.limit_pin_low:
            self.flags &= ~F1
            self.integral_position = self.command << 8
            self.velocity_held = self.stop_latched

    def set_limit_pin(self, low: bool) -> bool:
        """Move the LIMIT pin; low latches and goes to Init/Idle. Return whether it latched just now."""
        self.limit_pin_low = low
        if not low or self.limit_latched:
            return False
        self.limit_latched = True
        self.go_idle()
        return True

    def set_stop_pin(self, low: bool) -> bool:
        """Move the STOP pin; low latches and holds integral velocity. Return whether it latched just now."""
        self.stop_pin_low = low
        if not low or self.stop_latched:
            return False
        self.stop_latched = True
        self.velocity_held = True
        return True

    def release_latches(self) -> None:
        """What a write to 07H does to STOP and LIMIT: each is released if its pin is high."""
        self.stop_latched = self.stop_latched and self.stop_pin_low
        self.limit_latched = self.limit_latched and self.limit_pin_low

    def load_position(self, position: int) -> None:
        """Set the position counter."""
        self.origin = self.count - position
        self.previous = position

    def latch_position(self) -> None:
        """Latch 12H–14H, as reading 14H does."""
        self._position_latch = self.actual

    def read(self, register: int) -> int:
        """Return a register's byte; reading 14H latches the position first."""
        if register == 0x14:
            self.latch_position()
        if 0x0C <= register <= 0x0E:
            return self.command >> 8 * (0x0E - register) & 0xFF
        if 0x12 <= register <= 0x14:
            return self._position_latch >> 8 * (0x14 - register) & 0xFF
        if 0x18 <= register <= 0x1F:
            return self.storage[register - 0x18]
        if 0x29 <= register <= 0x2B:
            return self.final_bytes[register - 0x29]
        values = {
            0x00: self.flags,
            0x07: self.status,
            0x08: self.motor_command + 128,
            # In control the PWM port follows the motor command.
            0x09: int(self.motor_command * 100 / 128) if self.in_control else self.pwm,
            0x0F: self.timer,
            0x20: self.filter.zero,
            0x21: self.filter.pole,
            0x22: self.filter.gain,
            0x23: self.velocity_command,
            0x24: self.velocity_command >> 8,
            0x26: self.acceleration,
            0x27: self.acceleration >> 8,
            0x28: self.maximum_velocity,
            0x34: self.actual_velocity,
            0x35: self.actual_velocity >> 8,
            0x3C: self.integral_command,
        }
        if register not in values:
            raise ValueError(f"register {register:02X}H cannot be read")
        return values[register] & 0xFF

    def write(self, register: int, value: int) -> None:
        """Write one byte; what the chip does not take in its present mode it ignores."""
        idle = bool(self.flags & F1)
        if register == 0x00:
            flag = 1 << (value & 7) & _HOST_FLAGS
            self.flags = self.flags | flag if value & 8 else self.flags & ~flag
            if flag == F0 and value & 8 and not idle:
                self.start_profile()
        elif register == 0x05:
            self._write_program_counter(value)
        elif register == 0x07:
            self.status_nibble = value & 0x07
            self.release_latches()
        elif register == 0x08 and idle:
            self.motor_command = value - 128
        elif register == 0x09 and idle:
            self.pwm = signed(value, 8)
        elif register in (0x0C, 0x0D):
            self._command_buffer[register - 0x0C] = value
        elif register == 0x0E:
            high, middle = self._command_buffer
            self.set_command(signed(high << 16 | middle << 8 | value, 24))
        elif register == 0x0F:
            self.timer = value
        elif register == 0x13:
            self.load_position(0)
        elif register in (0x15, 0x16) and idle:
            self._preset_buffer[register - 0x15] = value
        elif register == 0x17 and idle:
            high, middle = self._preset_buffer
            self.load_position(signed(high << 16 | middle << 8 | value, 24))
        elif 0x18 <= register <= 0x1F:
            self.storage[register - 0x18] = value
        else:
            self._write_motion(register, value)

    def _write_program_counter(self, value: int) -> None:
        if value == 0x00:
            self.reset()
        elif value == 0x01:
            self.go_idle()
        elif value == 0x03:
            self.enter_control()

    def _write_motion(self, register: int, value: int) -> None:
        if register in (0x20, 0x21, 0x22):
            gains = [self.filter.zero, self.filter.pole, self.filter.gain]
            gains[register - 0x20] = value
            self.filter.load(*gains)
        elif register == 0x23:
            self.velocity_command = signed(self.velocity_command & 0xFF00 | value, 16)
        elif register == 0x24:
            self.velocity_command = signed(value << 8 | self.velocity_command & 0xFF, 16)
        elif register == 0x26:
            self.acceleration = self.acceleration & 0x7F00 | value
        elif register == 0x27:
            self.acceleration = (value & 0x7F) << 8 | self.acceleration & 0xFF
        elif register == 0x28:
            self.maximum_velocity = value & 0x7F
        elif register in (0x29, 0x2A, 0x2B):
            self.final_bytes[register - 0x29] = value
        elif register == 0x3C:
            self.integral_command = signed(value, 8)
            # A triggered STOP lets go only of a velocity that is written after its release.
            self.velocity_held = self.stop_latched

    def set_command(self, position: int) -> None:
        """Set the command position, with its fraction of integral velocity mode at zero."""
        self.command = position
        self.integral_position = position << 8

    def start_profile(self) -> None:
        """Set F0: take the parameters; the next sample is the profile's first, with the old command."""
        self.profile = Trapezoid(self.command, self.final, self.acceleration, self.maximum_velocity)
        self.profile_sample = -1
        self.flags |= F0

    def update_command(self) -> bool:
        """Begin a sample in control: move the command position. Return whether a profile ended with it."""
        flags = self.flags
        if flags & F0 and self.profile is not None:
            self.profile_sample += 1
            self.command = self.profile.command(self.profile_sample)
            if self.profile_sample >= self.profile.last:
                self.flags = flags & ~F0
                self.profile = None
                return True
        elif flags & F3:
            self.command = self.actual
        elif flags & F5:
            target = 0 if self.velocity_held else self.integral_command << 8
            change = target - self.integral_velocity
            self.integral_velocity += min(max(change, -self.acceleration), self.acceleration)
            position = self.integral_position + self.integral_velocity
            self.command = wrap24(position >> 8)
            self.integral_position = (self.command << 8) + (position & 0xFF)
        return False

    def update_output(self) -> None:
        """End a sample in control: rewrite 08H from the filter."""
        actual = self.actual
        if self.flags & F3:
            self.actual_velocity = wrap24(actual - self.previous)
            error_16 = self.velocity_command - 16 * self.actual_velocity
            self.motor_command = self.filter.step_velocity(error_16)
        else:
            self.motor_command = self.filter.step(wrap24(self.command - actual))
        self.previous = actual
