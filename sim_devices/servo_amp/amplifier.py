"""One PWM servo amplifier: control word, bridge, faults, watchdog, and what its registers show."""

import struct
from collections.abc import Callable
from enum import Flag
from math import inf

from sim_devices.joint import Joint
from sim_devices.motor import Bridge

UNDER_VOLTAGE_V = 20.0
OVER_VOLTAGE_V = 60.0
_STANDING_COUNTS_S = 1.0
_AT_COMMAND = 0.01
INHIBIT, BRAKE, COMMANDED_STOP, RESET_EVENTS = 1 << 0, 1 << 1, 1 << 6, 1 << 12
WRITE_ACCESS = (0x000E, 0x000F)

COMPLETE, INVALID, NO_ACCESS = 1, 4, 6


class Fault(Flag):
    """What can go wrong: 02.01 in the low word, 02.02 in the high one."""

    INTERNAL_ERROR = 1 << 1
    SHORT_CIRCUIT = 1 << 2
    CURRENT_OVERSHOOT = 1 << 3
    UNDER_VOLTAGE = 1 << 4
    OVER_VOLTAGE = 1 << 5
    OVER_TEMPERATURE = 1 << 6
    MOTOR_OVER_TEMPERATURE = 1 << 20
    FEEDBACK_ERROR = 1 << 22
    OVER_SPEED = 1 << 23
    COMMUNICATION_ERROR = 1 << 26


NO_FAULT = Fault(0)


def text_words(text: str, size: int) -> bytes:
    """Return ASCII text in `size` bytes, filled with zeros."""
    return text.encode("ascii")[:size].ljust(size, b"\0")


class Amplifier:
    """An amplifier on its joint; `on_fault(on)` is the wire to the board's amplifier-fault input."""

    def __init__(self, address: int, name: str, joint: Joint) -> None:
        self.address = address
        self.name = name
        self.joint = joint
        self.on_fault: Callable[[bool], None] = lambda on: None
        self.user_inhibit = False
        self.causes = NO_FAULT
        self.encoder_lost = False
        self._lost_at = 0
        joint.on_due = self._expire
        self.power_up()

    def power_up(self) -> None:
        """Begin anew: inhibited, position 0, "was reset" shown."""
        self.control = INHIBIT
        self.access = 0
        self.watchdog_ms = 0
        self.interface_input = bytes(4)
        self.was_reset = True
        self.latched = self.causes
        self.joint.due = inf
        self._zero = self._counted
        self._apply()

    # What happens to it

    def set_cause(self, fault: Fault, on: bool) -> None:
        """Let the cause of a fault appear or go; what it latched stays until events are reset."""
        self.causes = self.causes | fault if on else self.causes & ~fault
        self.latched |= self.causes
        self._apply()

    def set_encoder_lost(self, lost: bool) -> None:
        """Pull or plug the encoder at the amplifier; the counts in between are lost."""
        if lost and not self.encoder_lost:
            self._lost_at = self._counted
        elif self.encoder_lost and not lost:
            self._zero += self.joint.count - self._lost_at
        self.encoder_lost = lost
        self.set_cause(Fault.FEEDBACK_ERROR, lost)

    def set_bus(self, volts: float) -> None:
        """Change the bus voltage; ours: under 20 V and over 60 V are faults."""
        self.joint.motor.set_bus(volts)
        self.set_cause(Fault.UNDER_VOLTAGE, volts < UNDER_VOLTAGE_V)
        self.set_cause(Fault.OVER_VOLTAGE, volts > OVER_VOLTAGE_V)

    def set_user_inhibit(self, on: bool) -> None:
        """Operate the inhibit input; no fault."""
        self.user_inhibit = on
        self._apply()

    def feed(self, t: float) -> None:
        """A command to this address was answered 1: the watchdog counts anew."""
        self.joint.due = t + self.watchdog_ms / 1000 if self.watchdog_ms else inf

    def _expire(self) -> None:
        self.joint.due = inf
        self.latched |= Fault.COMMUNICATION_ERROR
        self._apply()

    def _apply(self) -> None:
        """Put the bridge into the state that control word, inputs and faults ask for."""
        motor = self.joint.motor
        # An inhibited bridge cannot brake: every switch is off.
        if self.latched or self.user_inhibit or self.control & INHIBIT:
            motor.bridge = Bridge.INHIBITED
        elif self.control & BRAKE:
            motor.bridge = Bridge.BRAKED
        else:
            motor.bridge = Bridge.ENABLED
        motor.held_at_zero = bool(self.control & COMMANDED_STOP)
        self.joint.refresh()
        self.on_fault(bool(self.latched))

    @property
    def _counted(self) -> int:
        return self._lost_at if self.encoder_lost else self.joint.count

    # Registers

    def _words(self) -> dict[int, dict[int, bytes]]:
        """Return index → offset → contents, from the joint as it is now."""
        joint, motor = self.joint, self.joint.motor
        amperes_to_counts = (1 << 13) / motor.peak
        speed = 0.0 if self.encoder_lost else joint.w
        limited = abs(motor.current(joint.w)) < abs(motor.demand(joint.w)) and not (
            motor.positive_blocked or motor.negative_blocked
        )
        top = max(max(motor.speeds), 1.0)
        bridge = _bits(
            (0, motor.bridge is Bridge.ENABLED),
            (1, motor.bridge is Bridge.BRAKED),
            (5, joint.positive_closed),
            (6, joint.negative_closed),
        )
        drive = _bits(
            (1, bool(self.control & INHIBIT)),
            (2, self.user_inhibit),
            (3, joint.positive_closed),
            (4, joint.negative_closed),
            (5, limited),
            (6, motor.folded),
            (12, bool(self.control & BRAKE)),
        )
        motion = _bits(
            (0, abs(speed) < _STANDING_COUNTS_S),
            (1, motor.bridge is Bridge.ENABLED and abs(motor.target - joint.w) <= _AT_COMMAND * top),
        )
        return {
            0x01: {0: _u16(self.control)},
            0x02: {
                0: _u16(bridge),
                1: _u16(self.latched.value & 0xFFFF | self.was_reset),
                2: _u16(self.latched.value >> 16),
                3: _u16(drive),
                4: _u16(motion),
            },
            0x04: {1: _u16(self.watchdog_ms)},
            0x07: {0: _u16(self.access)},
            0x0B: {0: text_words(f"{self.name} servo amplifier", 128) + text_words("emulated 1.0", 128)},
            0x0F: {0: _u16(round(motor.bus_volts * 10))},
            0x10: {
                2: _i16(motor.demand(joint.w) * amperes_to_counts),
                3: _i16(motor.current(joint.w) * amperes_to_counts),
            },
            0x11: {2: _i32(speed * (1 << 17) / 20000)},
            0x12: {0: _i32(self._counted - self._zero)},
            0x45: {0: self.interface_input},
            0x8C: {0: self._product()},
        }

    def _product(self) -> bytes:
        texts = ("emulated", "PWM servo amplifier", self.name, f"address {self.address:02X}H", "1.0")
        strings = b"".join(text_words(text, 32) for text in texts)
        return bytes(2) + strings + bytes(30) + bytes(5 * 32)

    def read(self, index: int, offset: int, words: int) -> bytes | None:
        """Return `words` words over consecutive offsets, or None where one of them is no register."""
        image: dict[int, bytes] = {}
        for start, contents in self._words().get(index, {}).items():
            for n in range(0, len(contents), 2):
                image[start + n // 2] = contents[n : n + 2]
        wanted = range(offset, offset + words)
        if words == 0 or not image.keys() >= set(wanted):
            return None
        return b"".join(image[place] for place in wanted)

    def write(self, index: int, offset: int, data: bytes) -> int:
        """Write one whole register; return the status."""
        if (index, offset, len(data)) == (0x07, 0, 2):
            (self.access,) = struct.unpack("<H", data)
            return COMPLETE
        if index == 0x07:
            return INVALID
        if self.access not in WRITE_ACCESS:
            return NO_ACCESS
        if (index, offset, len(data)) == (0x45, 0, 4):
            self.interface_input = data
            return COMPLETE
        if (index, offset, len(data)) not in ((0x01, 0, 2), (0x04, 1, 2)):
            return INVALID
        (value,) = struct.unpack("<H", data)
        if index == 0x04:
            self.watchdog_ms = value
        else:
            self._write_control(value)
        return COMPLETE

    def _write_control(self, value: int) -> None:
        if self.control & RESET_EVENTS and not value & RESET_EVENTS:
            self.was_reset = False
            self.latched = self.causes
        self.control = value
        self._apply()


def _bits(*bits: tuple[int, bool]) -> int:
    return sum(1 << bit for bit, on in bits if on)


def _u16(value: int) -> bytes:
    return struct.pack("<H", value & 0xFFFF)


def _i16(value: float) -> bytes:
    return struct.pack("<h", min(max(round(value), -0x8000), 0x7FFF))


def _i32(value: float) -> bytes:
    return struct.pack("<I", round(value) & 0xFFFFFFFF)
