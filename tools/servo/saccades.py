"""Saccades on the emulated head: one joint over 30°, and four that arrive together."""

from __future__ import annotations

import asyncio
import math
from contextlib import ExitStack
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from medusa.head.joint_group import JointGroup
from medusa.head.saccade import saccade_targets
from medusa.mc3000.drive import Mc3000Drive
from medusa.simulation import SimulatedHead

Floats = NDArray[np.float64]
HOLD_SECONDS = 0.2


@dataclass(frozen=True)
class SaccadeRun:
    """A saccade at every sample, by joint: loop time s, degrees; `ends` is when each command became the last."""

    time: dict[str, Floats]
    command_deg: dict[str, Floats]
    angle_deg: dict[str, Floats]
    ends: dict[str, float]
    start: float
    planned_seconds: float
    settled: bool
    error_counts: dict[str, int]
    error_deg: dict[str, float]

    @property
    def end(self) -> float:
        """Loop time of the last end, s."""
        return max(self.ends.values())

    @property
    def end_spread(self) -> float:
        """Between the first and the last end, s."""
        return max(self.ends.values()) - min(self.ends.values())


async def run_saccade(sim: SimulatedHead, head: JointGroup, targets: dict[str, float]) -> SaccadeRun:
    """Jump to `targets` (rad), hold a little, and take everything from the emulator out of band."""
    with ExitStack() as stack:
        recordings = {name: stack.enter_context(sim.machine.record(name)) for name in targets}
        await asyncio.sleep(0.02)
        report = await head.move(targets, together=True)
        await asyncio.sleep(HOLD_SECONDS)
    time, command, angle, ends, errors, error_deg = {}, {}, {}, {}, {}, {}
    starts = []
    axes = Mc3000Drive.of(head).axes
    for name, recording in recordings.items():
        scale = axes[name].counts_per_radian
        time[name] = np.array(recording.time)
        command[name] = np.degrees(np.array(recording.command) / scale)
        angle[name] = np.degrees(np.array(recording.angle))
        last = recording.command[-1]
        ends[name] = recording.time[recording.command.index(last)]
        starts.append(ends[name] - report.plan.seconds[name])
        errors[name] = last - recording.actual[-1]
        error_deg[name] = math.degrees(targets[name]) - float(angle[name][-1])
    return SaccadeRun(
        time=time,
        command_deg=command,
        angle_deg=angle,
        ends=ends,
        start=min(starts),
        planned_seconds=report.plan.duration,
        settled=report.all_settled,
        error_counts=errors,
        error_deg=error_deg,
    )


def four_joint_targets() -> dict[str, float]:
    """Pan 20°, tilt −5°, version 10°, vergence 4°, rad: the saccade of the README."""
    now = {"left_vergence": 0.0, "right_vergence": 0.0}
    return saccade_targets(
        now,
        pan=math.radians(20),
        tilt=math.radians(-5),
        version=math.radians(10),
        vergence=math.radians(4),
    )
