"""The named operations of one axis, with everything that refuses them."""

from collections.abc import Iterable

from sim_devices.hctl1100 import F0, F3, F5
from sim_devices.link.device import Refused
from sim_devices.mc3000.channel import Channel
from sim_devices.mc3000.reports import IDLE, INTEGRAL_VELOCITY, POSITION, PROPORTIONAL_VELOCITY

OK, OUT_OF_RANGE, BAD_REGISTER, WRONG_MODE, PROFILE_RUNS, FAULT_LATCHED, EMERGENCY_LATCHED = 0, *range(4, 10)
_PRECEDENCE = (BAD_REGISTER, EMERGENCY_LATCHED, FAULT_LATCHED, PROFILE_RUNS, WRONG_MODE, OUT_OF_RANGE, OK)
_SHORTEST_TIMER = {IDLE: 0, POSITION: 7, PROPORTIONAL_VELOCITY: 7, INTEGRAL_VELOCITY: 15}
_SHORTEST_PROFILE_TIMER = 15
_FILTER_REGISTERS = {0x20, 0x21, 0x22, 0x0F}
_MODE_FLAGS = {POSITION: 0, PROPORTIONAL_VELOCITY: F3, INTEGRAL_VELOCITY: F5}
LARGEST_STEP = 127


def first_status(statuses: Iterable[int]) -> int:
    """Return the status that goes before the others."""
    return min(statuses, key=_PRECEDENCE.index, default=OK)


def refuse(status: int) -> None:
    """Raise Refused unless the status is 0."""
    if status != OK:
        raise Refused(status)


def verdict(
    axis: Channel,
    *,
    drives: bool = False,
    busy: bool = False,
    wrong_mode: bool = False,
    out_of_range: bool = False,
) -> int:
    """Return the status of what was asked; `drives`: refused while anything is latched."""
    if drives and axis.emergency:
        return EMERGENCY_LATCHED
    if drives and (axis.chip.limit_latched or axis.fault_latched):
        return FAULT_LATCHED
    if busy:
        return PROFILE_RUNS
    if wrong_mode:
        return WRONG_MODE
    return OUT_OF_RANGE if out_of_range else OK


def is_busy(axis: Channel) -> bool:
    """Whether a profile runs or a STOP is under way: no mode but 0, no command data."""
    return axis.profile_running or axis.stopping


def is_position(value: int) -> bool:
    """Whether the chip's 24 bits hold it."""
    return -0x800000 <= value <= 0x7FFFFF


def timer_too_short(axis: Channel, timer: int) -> bool:
    """Whether T is below the minimum of what runs."""
    return timer < _SHORTEST_TIMER[axis.mode]


def set_mode(axis: Channel, mode: int) -> None:
    """MODE."""
    if mode == IDLE:
        axis.go_idle()
        axis.watchdog_expired = False
        return
    if mode not in _MODE_FLAGS:
        raise Refused(OUT_OF_RANGE)
    chip = axis.chip
    changes = mode != axis.mode
    refuse(
        verdict(
            axis,
            drives=True,
            busy=is_busy(axis),
            wrong_mode=changes and not axis.filter_chosen,
            out_of_range=changes
            and (
                chip.timer < _SHORTEST_TIMER[mode] or (mode == INTEGRAL_VELOCITY and chip.acceleration == 0)
            ),
        )
    )
    axis.armed = None
    axis.watchdog_expired = False
    if not changes:
        return
    # Entering from idle, and leaving mode 2, whose command follows the shaft, begin where the axis is.
    chip.set_command(chip.actual if axis.mode in (IDLE, PROPORTIONAL_VELOCITY) else chip.command)
    chip.flags = chip.flags & ~(F0 | F3 | F5) | _MODE_FLAGS[mode]
    chip.velocity_command = chip.integral_command = chip.integral_velocity = 0
    if axis.mode == IDLE:
        chip.enter_control()
    else:
        chip.velocity_held = chip.stop_latched
    axis.mode = mode


def command(axis: Channel, position: int) -> None:
    """COMMAND."""
    refuse(
        verdict(
            axis,
            drives=True,
            busy=is_busy(axis),
            wrong_mode=axis.mode != POSITION,
            out_of_range=not is_position(position),
        )
    )
    axis.armed = None
    axis.chip.set_command(position)


def set_filter(axis: Channel, zero: int, pole: int, gain: int, timer: int) -> None:
    """FILTER."""
    refuse(verdict(axis, busy=axis.profile_running, out_of_range=timer_too_short(axis, timer)))
    axis.chip.filter.load(zero, pole, gain)
    axis.set_timer(timer)
    axis.filter_registers |= _FILTER_REGISTERS


def velocity(axis: Channel, value: int) -> None:
    """VELOCITY."""
    chip = axis.chip
    refuse(
        verdict(
            axis,
            drives=True,
            busy=is_busy(axis),
            wrong_mode=axis.mode not in (PROPORTIONAL_VELOCITY, INTEGRAL_VELOCITY),
            out_of_range=axis.mode == INTEGRAL_VELOCITY
            and (not -128 <= value <= 127 or abs(value - chip.integral_command) > LARGEST_STEP),
        )
    )
    if axis.mode == PROPORTIONAL_VELOCITY:
        chip.velocity_command = value
    else:
        chip.write(0x3C, value & 0xFF)


def profile(axis: Channel, acceleration: int, maximum: int) -> None:
    """PROFILE."""
    refuse(
        verdict(
            axis,
            busy=axis.profile_running,
            out_of_range=acceleration > 0x7FFF
            or maximum > 0x7F
            or (axis.mode == INTEGRAL_VELOCITY and acceleration == 0),
        )
    )
    axis.chip.acceleration = acceleration
    axis.chip.maximum_velocity = maximum


def _cannot_go(axis: Channel, final: int) -> bool:
    chip = axis.chip
    return final != chip.command and (chip.acceleration == 0 or chip.maximum_velocity == 0)


def move(axis: Channel, final: int, start: int) -> None:
    """MOVE: begin a profile (1) or arm it (0)."""
    refuse(
        verdict(
            axis,
            drives=True,
            busy=is_busy(axis),
            wrong_mode=axis.mode != POSITION,
            out_of_range=not is_position(final)
            or start not in (0, 1)
            or axis.chip.timer < _SHORTEST_PROFILE_TIMER
            or (start == 1 and _cannot_go(axis, final)),
        )
    )
    if start:
        _begin(axis, final, axis.start_tick)
    else:
        axis.armed = final


def _begin(axis: Channel, final: int, tick: int) -> None:
    axis.armed = None
    axis.chip.final_bytes[:] = (final & 0xFFFFFF).to_bytes(3, "little")
    axis.chip.start_profile()
    axis.profile_from = tick


def start_armed(axes: list[Channel], valid: bool) -> None:
    """START: all axes named, or none; `valid`: whether the mask was."""
    statuses = [OK if valid else OUT_OF_RANGE]
    for axis in axes:
        armed = axis.armed
        statuses.append(
            verdict(
                axis,
                drives=True,
                busy=is_busy(axis),
                wrong_mode=armed is None,
                out_of_range=axis.chip.timer != axes[0].chip.timer
                or axis.chip.timer < _SHORTEST_PROFILE_TIMER
                or (armed is not None and _cannot_go(axis, armed)),
            )
        )
    refuse(first_status(statuses))
    tick = max(axis.start_tick for axis in axes)
    for axis in axes:
        assert axis.armed is not None
        _begin(axis, axis.armed, tick)


def preset(axis: Channel, actual: int) -> None:
    """PRESET."""
    refuse(verdict(axis, wrong_mode=axis.mode != IDLE, out_of_range=not is_position(actual)))
    axis.chip.load_position(actual)
    void_marks(axis)


def void_marks(axis: Channel) -> None:
    """Clear registers 18H–1BH: the count that they spoke of is void."""
    axis.chip.storage[:4] = bytes(4)


def set_limit_enable(axis: Channel, enable: int) -> None:
    """LIMIT_ENABLE."""
    refuse(verdict(axis, wrong_mode=axis.mode != IDLE and enable == 0, out_of_range=enable > 1))
    axis.limit_enable = bool(enable)
    axis.update_limit()


def stop(axis: Channel) -> None:
    """STOP: accepted in every state; the axis ends at rest by its ramp."""
    chip = axis.chip
    axis.armed = None
    if axis.mode == IDLE:
        zero_open_loop(axis)
    elif axis.stopping:
        return
    elif chip.profile is not None:
        chip.profile.stop(chip.profile_sample)
        axis.begin_stop()
    elif axis.mode == INTEGRAL_VELOCITY:
        chip.integral_command = 0
        axis.begin_stop()
    elif axis.mode == PROPORTIONAL_VELOCITY:
        chip.velocity_command = 0
        axis.begin_stop()


def zero_open_loop(axis: Channel) -> None:
    """Take back a motor command that was written in idle."""
    if axis.mode == IDLE:
        axis.chip.motor_command = axis.chip.pwm = 0
        axis.joint.drive(0)


def clear(axis: Channel) -> None:
    """CLEAR: release what is latched and whose cause is gone."""
    axis.armed = None
    axis.emergency = False
    axis.update_limit()
    axis.chip.release_latches()
    axis.fault_latched = axis.fault_input
