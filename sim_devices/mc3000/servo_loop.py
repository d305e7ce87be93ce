"""The board's inner loop: ordinary samples of chip and motor, one after the other, in local variables.

Ordinary: position, profile or steady integral velocity, an enabled bridge, no friction, no mark of the joint within
reach. Everything else goes sample by sample through `Channel`, with the same results to the last bit.
"""

from collections.abc import Callable, Generator
from math import floor

from sim_devices.hctl1100 import F0, F5, Hctl1100
from sim_devices.joint import Joint
from sim_devices.step_table import StepTable

_WIDEST_ERROR = 0x7FFFFF
_BLOCK = 64

Run = Generator[int, int | None, None]
"""Send the last tick to sample at, receive the first one that is left; None, or its own end, writes back."""


def _upcoming(chip: Hctl1100) -> Callable[[int], list[int]] | None:
    """Return what gives the commands of the n-th sample from now on (n ≥ 1), empty where they are not ordinary."""
    if chip.flags & F0:
        profile, before = chip.profile, chip.profile_sample
        assert profile is not None
        # The sample in which F0 clears is not ordinary.
        return lambda n: profile.commands(before + n, min(before + n + _BLOCK, profile.last))
    if chip.flags & F5:
        velocity, start = chip.integral_velocity, chip.integral_position
        if velocity != (0 if chip.velocity_held else chip.integral_command << 8):
            return None
        # Neither is the wrap of the 24-bit position.
        return lambda n: (
            [start + velocity * k >> 8 for k in range(n, n + _BLOCK)]
            if abs(start + velocity * (n + _BLOCK)) < _WIDEST_ERROR << 8
            else []
        )
    block = [chip.command] * _BLOCK
    return lambda n: block


def ordinary_samples(
    chip: Hctl1100, joint: Joint, tick: int, period: int, period_s: float, limit: int, encoder_shift: int
) -> Run | None:
    """Return the run of ordinary samples that begins at `tick`, or None if there is none.

    `limit`: the following limit, 0 for none. The shaft must stand one whole period before `tick`. While the run
    lasts chip and joint are out of date; its end brings them to the last sample taken.
    """
    table = joint.step_table
    if table is None or table.period_s != period_s or table.speeds is not joint.motor.speeds:
        table = joint.step_table = StepTable(joint.motor, period_s)
    low, high = joint.free_range(table.rest)
    upcoming = _upcoming(chip) if low < joint.m < high else None
    if upcoming is None:
        return None
    run = _run(chip, joint, tick, period, table, limit or _WIDEST_ERROR, encoder_shift, upcoming)
    next(run)
    return run


def _run(
    chip: Hctl1100,
    joint: Joint,
    tick: int,
    period: int,
    table: StepTable,
    limit: int,
    encoder_shift: int,
    upcoming: Callable[[int], list[int]],
) -> Run:
    low, high = joint.free_range(table.rest)
    decay, reach, travels, gains = table.decay, table.reach, table.travels, table.gains
    digital = chip.filter
    forward, delayed, feedback = digital.forward, digital.delayed, digital.feedback
    error, output = digital.error, digital.output
    m, w = joint.m, joint.w
    origin = chip.origin - encoder_shift
    least = -limit
    command = chip.command
    block: list[int] = []
    at = 0
    first = tick
    last = yield tick
    while last is not None:
        while tick <= last:
            if at == len(block):
                block = upcoming((tick - first) // period + 1)
                at = 0
                if not block:
                    break
            there = m + (w * reach + travels[output])
            if not low < there < high:
                break
            x = block[at] + origin - floor(there)
            if not least <= x <= limit:
                break
            m = there
            w = w * decay + gains[output]
            output = int(forward * x - delayed * error - feedback * output)
            if output > 127:
                output = 127
            elif output < -128:
                output = -128
            error = x
            command = block[at]
            at += 1
            tick += period
        else:
            last = yield tick
            continue
        break
    done = (tick - first) // period
    if done:
        joint.m = joint.j = m
        joint.w = w
        joint.drive(output)
        digital.error, digital.output = error, output
        chip.motor_command = output
        chip.command = command
        chip.count = command + chip.origin - error
        chip.previous = command - error
        if chip.flags & F0:
            chip.profile_sample += done
        elif chip.flags & F5:
            chip.integral_position += chip.integral_velocity * done
    if last is not None:
        # What comes next is for the caller to sample.
        yield tick
