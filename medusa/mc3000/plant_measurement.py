"""Measuring a joint's plant on the machine: bounded open-loop pulses from idle, watched all the time.

The motor command goes straight to the DAC (08H). Every pulse is short, within an excursion about where the joint
is; the board's watchdog, set short for the while, ends it if the host dies.
"""

from __future__ import annotations

import asyncio
import logging
import math
from dataclasses import dataclass

import numpy as np

from medusa.completion import run_to_completion
from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.head.joint_group import JointGroup
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Mode, Register, WatchdogAction
from medusa.mc3000.board.registers import MOTOR_COMMAND_ZERO
from medusa.mc3000.drive import Mc3000Drive
from medusa.servo.identification import Identification, Pulse, estimate_plant

log = logging.getLogger(__name__)

WRAP_US = 1 << 32
WATCHDOG_MS = 100
PROBE_SECONDS = 0.06
PROBE_DAC = 4
PROBE_ENOUGH_COUNTS = 60
REST_LOOKS = 8
LOOK_SECONDS = 0.005
"""About what a snapshot takes at 115200 baud."""
GOLDEN = 0.6180339887498949
REST_SECONDS = 3.0
REST_COUNTS = 1
CLEARANCE = 2.0
"""Needed each way, in excursions: a pulse whose end is lost runs on until the watchdog has expired."""


@dataclass(frozen=True)
class Excitation:
    """Bounds of the pulses: rad from where the joint is, s a pulse, DAC counts."""

    excursion: float = math.radians(8.0)
    pulse_seconds: float = 0.15
    largest_dac: int = 40
    repeats: int = 2

    def __post_init__(self) -> None:
        if not 0 < self.excursion <= math.radians(30.0):
            raise CommandError(f"an excursion of {math.degrees(self.excursion):g}° is not in (0, 30]°")
        if not 0.05 <= self.pulse_seconds <= 0.5:
            raise CommandError(f"a pulse of {self.pulse_seconds:g} s is not in 0.05..0.5 s")
        if not 4 <= self.largest_dac <= 127:
            raise CommandError(f"a largest pulse of {self.largest_dac} DAC counts is not in 4..127")
        if not 1 <= self.repeats <= 10:
            raise CommandError(f"{self.repeats} repeats of the pulses are not in 1..10")


async def measure_plant(group: JointGroup, name: str, excitation: Excitation | None = None) -> Identification:
    """Measure T_M, C, friction and the asymmetry of one joint; it is left idle.

    Raises CommandError, and nothing moves, when the joint is not homed or is too near to a soft limit; DeviceFault
    when it does not move or runs out of its excursion (it is stopped then).
    """
    excitation = excitation or Excitation()
    drive = Mc3000Drive.of(group)
    axis = _axis(drive, name)
    # Where it is is asked before the amplifier is enabled: a refusal leaves the head as it was.
    await _check_margins(axis, excitation)
    await drive.enable([name], mode=Mode.IDLE)
    await axis.set_mode(Mode.IDLE)
    await drive.rest([name])
    try:
        shortest = min(WATCHDOG_MS, drive.config.safety.board_watchdog_ms)
        await axis.board.watchdog(shortest, WatchdogAction.IDLE)
        pulses = await _pulses(axis, excitation)
    except BaseException as error:
        # What ended the measurement is raised, not what then kept the joint from being confirmed at rest.
        try:
            await run_to_completion(_leave(drive, axis))
        except MedusaError as unconfirmed:
            log.error("%s: %s", name, unconfirmed)
        if isinstance(error, CommandError) and error.status is not None:
            # The joint was moving: a board that now refuses has stopped it.
            raise DeviceFault(f"{name}: stopped while it was measured: {error}", axis=name) from error
        raise
    await _leave(drive, axis)
    found = estimate_plant(pulses)
    log.info(
        "%s: T_M %.2f ms, C %.1f counts/s per DAC count, friction %.2f DAC counts",
        name,
        found.plant.time_constant * 1e3,
        found.plant.velocity_gain,
        found.friction_dac,
    )
    return found


def _axis(drive: Mc3000Drive, name: str) -> Axis:
    if name not in drive.axes:
        raise CommandError(f"there is no joint {name!r}; the head has {', '.join(drive.axes)}")
    return drive.axes[name]


async def _check_margins(axis: Axis, excitation: Excitation) -> None:
    if not axis.homed:
        raise CommandError(f"{axis.name}: is not homed, so its soft limits cannot be kept; home it first")
    angle = axis.to_angle(await axis.board.position(axis.channel))
    low, high = axis.config.soft_limits
    needed = CLEARANCE * excitation.excursion
    for limit in (low, high):
        if abs(limit - angle) < needed or not low <= angle <= high:
            raise CommandError(
                f"{axis.name}: is at {math.degrees(angle):.2f}°, {math.degrees(abs(limit - angle)):.2f}° from "
                f"its soft limit of {math.degrees(limit):.2f}°; the excitation needs {math.degrees(needed):.2f}° "
                "each way"
            )


async def _leave(drive: Mc3000Drive, axis: Axis) -> None:
    """The DAC at zero, the joint idle and at rest, the watchdog as the configuration has it."""
    try:
        await axis.set_mode(Mode.IDLE)
        await drive.rest([axis.name])
    finally:
        await drive.set_watchdog(axis.board)


async def _pulses(axis: Axis, excitation: Excitation) -> list[Pulse]:
    counts = abs(axis.counts_per_radian) * excitation.excursion
    watcher = _Watcher(axis, counts)
    dac, rate = await _probe(watcher, excitation)
    # The way of a pulse is at most C u d: chosen so that the greatest goes the excursion, or has the largest DAC.
    largest = min(excitation.largest_dac, int(counts / (rate * excitation.pulse_seconds)))
    largest = max(largest, 2 * dac)
    small = max(largest // 2, dac)
    log.debug("%s: pulses of %d and %d DAC counts", axis.name, largest, small)
    sizes = [way * size for size in (largest, small) for way in (1, -1)] * excitation.repeats
    return [await watcher.pulse(size, excitation.pulse_seconds) for size in sizes]


async def _probe(watcher: _Watcher, excitation: Excitation) -> tuple[int, float]:
    """The least doubling of DAC counts that moves the joint, and how much faster one more drives it (counts/s).

    Two sizes are tried, so that what the friction takes off both does not look like a slow joint.
    """
    dac = min(PROBE_DAC, excitation.largest_dac // 2)
    while True:
        moved, seconds = await _there_and_back(watcher, dac)
        if moved >= PROBE_ENOUGH_COUNTS:
            more, _ = await _there_and_back(watcher, 2 * dac)
            return dac, max(more - moved, moved) / (dac * seconds)
        if 4 * dac > excitation.largest_dac:
            raise DeviceFault(
                f"{watcher.axis.name}: {moved:.0f} counts after {dac} DAC counts for {PROBE_SECONDS * 1e3:.0f} ms, "
                f"{PROBE_ENOUGH_COUNTS} needed: no power, a stuck joint, or more friction than that",
                axis=watcher.axis.name,
            )
        dac *= 2


async def _there_and_back(watcher: _Watcher, dac: int) -> tuple[float, float]:
    """(counts gone, s that the pulse lasted), the greater of both ways."""
    there = await watcher.pulse(dac, PROBE_SECONDS)
    back = await watcher.pulse(-dac, PROBE_SECONDS)
    moved = max(abs(float(p.counts[-1] - p.counts[0])) for p in (there, back))
    return moved, (sum(there.off_bracket) - sum(there.on_bracket)) / 2


class _Watcher:
    """Drives one idle joint open-loop and records it by snapshots, as fast as the line takes them."""

    def __init__(self, axis: Axis, excursion_counts: float) -> None:
        self.axis = axis
        self._excursion = excursion_counts
        self._start: int | None = None
        self._origin_us: int | None = None
        self._count = 0
        self._samples: list[tuple[float, int, int]] = []

    async def pulse(self, dac: int, seconds: float) -> Pulse:
        """One pulse from rest to rest; the DAC is at zero when it ends, however it ends."""
        loop = asyncio.get_running_loop()
        self._samples = []
        # Each pulse is looked at in a phase of its own, or all would show the same rounding of the counts.
        self._count += 1
        phase = LOOK_SECONDS * (self._count * GOLDEN % 1.0)
        for _ in range(3):
            await self._look()
        try:
            await self._drive(dac)
            end = loop.time() + seconds
            await asyncio.sleep(phase)
            while loop.time() < end:
                await self._look()
        finally:
            await run_to_completion(self._drive(0))
        await asyncio.sleep(phase)
        await self._coast()
        time, counts, shown = zip(*self._samples, strict=True)
        return Pulse(dac, np.array(time), np.array(counts, dtype=np.float64), np.array(shown, dtype=np.int64))

    async def _drive(self, dac: int) -> None:
        await self.axis.board.write(
            self.axis.channel, Register.MOTOR_COMMAND, bytes([MOTOR_COMMAND_ZERO + dac])
        )

    async def _look(self) -> int:
        snapshot = await self.axis.board.snapshot()
        reading = snapshot.axes[self.axis.channel]
        if self._origin_us is None:
            self._origin_us = snapshot.time_us
        time = ((snapshot.time_us - self._origin_us) % WRAP_US) * 1e-6
        self._samples.append((time, reading.actual, reading.motor_command))
        if self._start is None:
            self._start = reading.actual
        if reading.mode is not Mode.IDLE:
            raise DeviceFault(f"{self.axis.name}: left idle while it was measured", axis=self.axis.name)
        away = abs(reading.actual - self._start)
        if away > 1.5 * self._excursion:
            raise DeviceFault(
                f"{self.axis.name}: ran {away} counts from where it was, {self._excursion:.0f} were meant; stopped",
                axis=self.axis.name,
            )
        return reading.actual

    async def _coast(self) -> None:
        """Look on until the joint is at rest; the board's own inputs end a pulse that meets a switch."""
        loop = asyncio.get_running_loop()
        deadline = loop.time() + REST_SECONDS
        history: list[int] = []
        while len(history) < REST_LOOKS or max(history) - min(history) > REST_COUNTS:
            if loop.time() > deadline:
                raise DeviceFault(
                    f"{self.axis.name}: does not come to rest within {REST_SECONDS:g} s of a pulse",
                    axis=self.axis.name,
                )
            history = [*history[1 - REST_LOOKS :], await self._look()]
