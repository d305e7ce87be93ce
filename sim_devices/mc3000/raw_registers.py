"""Raw READ and WRITE: a byte in a register means what the named operation for it means."""

from sim_devices.hctl1100 import F0, F3, F5, READABLE, WRITABLE, signed
from sim_devices.link.device import Refused
from sim_devices.mc3000.channel import Channel
from sim_devices.mc3000.operations import (
    BAD_REGISTER,
    LARGEST_STEP,
    OUT_OF_RANGE,
    PROFILE_RUNS,
    is_busy,
    move,
    refuse,
    set_mode,
    timer_too_short,
    verdict,
    void_marks,
)
from sim_devices.mc3000.reports import IDLE, INTEGRAL_VELOCITY, POSITION, PROPORTIONAL_VELOCITY

MOST_BYTES = 8
_FLAG_MODES = {F3: PROPORTIONAL_VELOCITY, F5: INTEGRAL_VELOCITY}


def read(axis: Channel, register: int, count: int) -> bytes:
    """READ: `count` bytes from `register` on; 14H latches before anything is read."""
    registers = range(register, register + max(count, 1))
    if not READABLE.issuperset(registers):
        raise Refused(BAD_REGISTER)
    if not 1 <= count <= MOST_BYTES:
        raise Refused(OUT_OF_RANGE)
    if 0x14 in registers:
        axis.chip.latch_position()
    return bytes(axis.chip.read(each) for each in registers)


def write(axis: Channel, register: int, data: bytes, *, watchdog_on: bool) -> None:
    """WRITE: checked whole, then byte by byte in ascending order."""
    registers = range(register, register + len(data))
    if not WRITABLE.issuperset(registers):
        raise Refused(BAD_REGISTER)
    if register == 0x00:
        _write_flag(axis, data[0])
    elif register == 0x05:
        _write_program_counter(axis, data[0])
    else:
        values = dict(zip(registers, data, strict=True))
        refuse(_check(axis, values, watchdog_on))
        for each, value in values.items():
            _apply(axis, each, value)


def _check(axis: Channel, values: dict[int, int], watchdog_on: bool) -> int:
    chip = axis.chip
    position = bool(values.keys() & {0x0C, 0x0D, 0x0E})
    proportional = bool(values.keys() & {0x23, 0x24})
    integral = 0x3C in values
    open_loop = values.get(0x08, 0x80) != 0x80 or values.get(0x09, 0) != 0
    settings = bool(values.keys() & {0x0F, 0x26, 0x27, 0x28, 0x29, 0x2A, 0x2B})
    idle_only = bool(values.keys() & {0x08, 0x09, 0x13, 0x15, 0x16, 0x17})
    command_data = position or proportional or integral
    low = values.get(0x26, chip.acceleration & 0xFF)
    high = values.get(0x27, chip.acceleration >> 8)
    return verdict(
        axis,
        drives=command_data or open_loop,
        busy=(command_data and is_busy(axis)) or (settings and axis.profile_running),
        wrong_mode=(position and axis.mode != POSITION)
        or (proportional and axis.mode != PROPORTIONAL_VELOCITY)
        or (integral and axis.mode != INTEGRAL_VELOCITY)
        or (idle_only and axis.mode != IDLE)
        or (open_loop and not watchdog_on),
        out_of_range=bool(values.get(0x07, 0) & 0x08)
        or abs(signed(values.get(0x09, 0), 8)) > 100
        or (0x0F in values and timer_too_short(axis, values[0x0F]))
        or high > 0x7F
        or values.get(0x28, 0) > 0x7F
        or (axis.mode == INTEGRAL_VELOCITY and high == low == 0)
        or (integral and abs(signed(values[0x3C], 8) - chip.integral_command) > LARGEST_STEP),
    )


def _apply(axis: Channel, register: int, value: int) -> None:
    chip = axis.chip
    if register == 0x0F:
        axis.set_timer(value)
    else:
        chip.write(register, value)
    if register == 0x08:
        axis.joint.drive(chip.motor_command)
    elif register == 0x0E:
        axis.armed = None
    elif register in (0x13, 0x15, 0x16, 0x17):
        void_marks(axis)
    elif register in (0x0F, 0x20, 0x21, 0x22):
        axis.filter_registers.add(register)


def _write_flag(axis: Channel, value: int) -> None:
    number, on = value & 7, bool(value & 8)
    flag = 1 << number
    if value & 0xF0 or number in (1, 6, 7):
        raise Refused(OUT_OF_RANGE)
    if flag == F0 and on:
        move(axis, axis.chip.final, 1)
    elif flag == F0 and axis.profile_running:
        raise Refused(PROFILE_RUNS)
    elif flag in _FLAG_MODES and axis.mode != IDLE:
        if on:
            set_mode(axis, _FLAG_MODES[flag])
        elif axis.mode == _FLAG_MODES[flag]:
            set_mode(axis, POSITION)
    else:
        axis.chip.write(0x00, value)


def _write_program_counter(axis: Channel, value: int) -> None:
    if value == 0x00:
        axis.go_idle()
        axis.chip.reset()
        axis.set_timer(axis.chip.timer)
        axis.filter_registers.clear()
    elif value == 0x01:
        set_mode(axis, IDLE)
    elif value == 0x03:
        set_mode(axis, POSITION)
    else:
        raise Refused(OUT_OF_RANGE)
