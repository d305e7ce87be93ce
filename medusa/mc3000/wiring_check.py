"""The first thing to do on hardware: short open-loop pulses, and do the counts follow with the right sign?"""

import asyncio
import json
import logging
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Self

from medusa.completion import complete
from medusa.errors import CommandError, ConfigError, DeviceFault
from medusa.mc3000.board import Inputs, Mode, Register
from medusa.mc3000.board.registers import MOTOR_COMMAND_ZERO
from medusa.mc3000.config import HeadConfig
from medusa.mc3000.homing.mark import axis_digest
from medusa.replace_file import replace_file

if TYPE_CHECKING:
    from medusa.head.joint_group import Head

log = logging.getLogger(__name__)

PULSE_SECONDS = 0.05
MAX_PULSE_COUNTS = 4
ENOUGH_COUNTS = 10
"""More than an encoder flickers at rest; reached by any pulse that overcomes the friction."""


class CheckRecord:
    """Which joints passed `check` with which configuration on which port, kept beside the configuration file.

    The port belongs to it: what the emulated head passed says nothing about the real one.
    """

    def __init__(self, path: Path | None, port: str, digests: Mapping[str, str]) -> None:
        self._path = path
        self._port = port
        self._digests = dict(digests)

    @classmethod
    def of(cls, config: HeadConfig, port: str) -> Self:
        """The record beside the configuration's file; a configuration made in the program has none."""
        if config.file is None:
            return cls(None, port, {})
        path = Path(config.file).with_suffix(".checked.json")
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            stored = {}
        except (OSError, ValueError) as error:
            raise ConfigError(str(path), "", None, f"the record of checks cannot be read: {error}") from None
        if not isinstance(stored, dict):
            raise ConfigError(str(path), "", None, "the record of checks is not a JSON object")
        return cls(path, port, {str(name): str(digest) for name, digest in stored.items()})

    def holds(self, name: str, config: HeadConfig) -> bool:
        """True when the joint was checked on this port with exactly this configuration.

        A head described by no file is the simulated one: its wiring is known and cannot have changed.
        """
        return self._path is None or self._digests.get(self._key(name)) == axis_digest(
            name, config.axis(name)
        )

    def _key(self, name: str) -> str:
        return f"{name} on {self._port}"

    def note(self, name: str, config: HeadConfig) -> None:
        """Record that the joint passed; the file is replaced whole or not at all."""
        if self._path is None:
            return
        self._digests[self._key(name)] = axis_digest(name, config.axis(name))
        replace_file(self._path, json.dumps(self._digests, indent=1, sort_keys=True) + "\n")


@dataclass(frozen=True)
class CheckResult:
    """What the pulses showed: the motor command that sufficed (DAC counts), counts gone each way."""

    axis: str
    motor_command_counts: int
    forward_counts: int
    backward_counts: int


async def check_axis(head: "Head", name: str) -> CheckResult:
    """Pulse one idle joint of an enabled bridge by at most 4 DAC counts for 50 ms each way.

    A motor command in the direction of the positive joint angle has to move the counts by the configured
    sign, or the closed loop would run away. Raises DeviceFault when they do not move or move wrongly.
    """
    axis = head.axes[name]
    await head.enable([name], mode=Mode.IDLE)
    try:
        await axis.set_mode(Mode.IDLE)
        inputs = await axis.board.inputs(axis.channel)
        closed = inputs & (Inputs.NEGATIVE_LIMIT | Inputs.POSITIVE_LIMIT | Inputs.LIMIT_LATCHED)
        if closed:
            raise CommandError(f"{name}: on a limit switch (inputs {inputs:02X}H); move it off by hand first")
        for size in range(1, MAX_PULSE_COUNTS + 1):
            forward = await _pulse(head, name, axis.config.sign * size)
            if abs(forward) >= ENOUGH_COUNTS:
                break
        else:
            raise DeviceFault(
                f"{name}: {forward} counts after {MAX_PULSE_COUNTS} DAC counts for {PULSE_SECONDS * 1000:.0f} ms,"
                f" {ENOUGH_COUNTS} needed: no power, a stuck joint or no encoder",
                axis=name,
            )
        backward = await _pulse(head, name, -axis.config.sign * size)
        for sent, went in ((axis.config.sign, forward), (-axis.config.sign, backward)):
            if went * sent <= 0:
                raise DeviceFault(
                    f"{name}: {went} counts after a motor command of {sent * size}: motor or encoder is wired"
                    " the wrong way round, and the closed loop would run away",
                    axis=name,
                )
    finally:
        await complete(head.disable([name]))
    CheckRecord.of(head.config, head.port_name).note(name, head.config)
    log.info("%s: checked, %d and %d counts", name, forward, backward)
    return CheckResult(name, size, forward, backward)


async def _pulse(head: "Head", name: str, motor_command: int) -> int:
    """Counts that the joint moves by an open-loop pulse; the board's watchdog ends it if the host dies."""
    axis = head.axes[name]
    before = await axis.board.position(axis.channel)
    try:
        await axis.board.write(
            axis.channel, Register.MOTOR_COMMAND, bytes([MOTOR_COMMAND_ZERO + motor_command])
        )
        await asyncio.sleep(PULSE_SECONDS)
    finally:
        await complete(_release(head, name))
    await head.rest([name])
    return await axis.board.position(axis.channel) - before


async def _release(head: "Head", name: str) -> None:
    axis = head.axes[name]
    await axis.board.write(axis.channel, Register.MOTOR_COMMAND, bytes([MOTOR_COMMAND_ZERO]))
