"""The first thing to do on hardware: short open-loop pulses, and do the counts follow with the right sign?"""

import asyncio
import logging
from dataclasses import dataclass

from medusa.completion import run_to_completion
from medusa.errors import CommandError, DeviceFault
from medusa.head.joint_group import JointGroup
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Inputs, Mode, Register
from medusa.mc3000.board.registers import MOTOR_COMMAND_ZERO
from medusa.mc3000.check_record import CheckRecord
from medusa.mc3000.drive import Mc3000Drive

log = logging.getLogger(__name__)

PULSE_SECONDS = 0.05
MAX_PULSE_COUNTS = 4
ENOUGH_COUNTS = 10
"""More than an encoder flickers at rest; reached by any pulse that overcomes the friction."""


@dataclass(frozen=True)
class CheckResult:
    """What the pulses showed: the motor command that sufficed (DAC counts), counts gone each way."""

    axis: str
    motor_command_counts: int
    forward_counts: int
    backward_counts: int


async def check_axis(group: JointGroup, name: str) -> CheckResult:
    """Pulse one idle joint with an enabled amplifier by at most 4 DAC counts for 50 ms each way.

    A motor command in the direction of the positive joint angle has to move the counts by the configured
    sign, or the closed loop would run away. Raises DeviceFault when they do not move or move wrongly.
    """
    drive = Mc3000Drive.of(group)
    axis = drive.axes[name]
    await drive.enable([name], mode=Mode.IDLE)
    try:
        await axis.set_mode(Mode.IDLE)
        inputs = await axis.board.inputs(axis.channel)
        closed = inputs & (Inputs.NEGATIVE_LIMIT | Inputs.POSITIVE_LIMIT | Inputs.LIMIT_LATCHED)
        if closed:
            raise CommandError(f"{name}: on a limit switch (inputs {inputs:02X}H); move it off by hand first")
        for size in range(1, MAX_PULSE_COUNTS + 1):
            forward = await _pulse(drive, name, axis.config.sign * size)
            if abs(forward) >= ENOUGH_COUNTS:
                break
        else:
            raise DeviceFault(
                f"{name}: {forward} counts after {MAX_PULSE_COUNTS} DAC counts for {PULSE_SECONDS * 1000:.0f} ms,"
                f" {ENOUGH_COUNTS} needed: no power, a stuck joint or no encoder",
                axis=name,
            )
        backward = await _pulse(drive, name, -axis.config.sign * size)
        for sent, went in ((axis.config.sign, forward), (-axis.config.sign, backward)):
            if went * sent <= 0:
                raise DeviceFault(
                    f"{name}: {went} counts after a motor command of {sent * size}: motor or encoder is wired"
                    " the wrong way round, and the closed loop would run away",
                    axis=name,
                )
    finally:
        await run_to_completion(group.disable([name]))
    CheckRecord.of(drive.config, drive.port_name).add(name, drive.config)
    log.info("%s: checked, %d and %d counts", name, forward, backward)
    return CheckResult(name, size, forward, backward)


async def _pulse(drive: Mc3000Drive, name: str, motor_command: int) -> int:
    """Counts that the joint moves by an open-loop pulse; the board's watchdog ends it if the host dies."""
    axis = drive.axes[name]
    before = await axis.board.position(axis.channel)
    try:
        await axis.board.write(
            axis.channel, Register.MOTOR_COMMAND, bytes([MOTOR_COMMAND_ZERO + motor_command])
        )
        await asyncio.sleep(PULSE_SECONDS)
    finally:
        await run_to_completion(_release(axis))
    await drive.rest([name])
    return await axis.board.position(axis.channel) - before


async def _release(axis: Axis) -> None:
    await axis.board.write(axis.channel, Register.MOTOR_COMMAND, bytes([MOTOR_COMMAND_ZERO]))
