"""Moves as the boards round them: trapezoids on the chip's registers, stretched to end in the same sample. Pure."""

import math
from collections.abc import Mapping
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.head.drive import MovePlan, Reading, Speeds
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import AxisSnapshot, Mode, Profile
from medusa.servo.profiles import Trapezoid, stretch_together


@dataclass(frozen=True)
class AxisMove:
    """One axis' part of a move: where to, counts, and by which registers."""

    final: int
    profile: Profile


def plan_move(
    axes: Mapping[str, Axis],
    reading: Reading,
    targets: Mapping[str, float],
    speeds: Mapping[str, Speeds],
    *,
    together: bool = False,
) -> MovePlan:
    """Profiles from the command positions of `reading` to `targets` (rad), on the chip's registers.

    Raises CommandError for a speed or an acceleration that the chip cannot do, or an axis that moves.
    """
    names = list(targets)
    profiles, periods, finals = [], [], {}
    for name in names:
        axis, joint = axes[name], reading.joints[name]
        if joint.moving:
            raise CommandError(f"{name}: is moving; a profile begins at rest")
        wanted = speeds.get(name, Speeds())
        registers = axis.profile(wanted.acceleration, wanted.max_speed)
        snapshot: AxisSnapshot = joint.device
        finals[name] = axis.to_counts(targets[name])
        distance = finals[name] - snapshot.command
        profiles.append(Trapezoid(distance, registers.acceleration_256, registers.maximum))
        periods.append(axis.sample_period(Mode.POSITION))
    early: list[int] = []
    if together:
        profiles, early = stretch_together(profiles, periods)
    seconds, peaks, moves = {}, {}, {}
    for name, profile, period in zip(names, profiles, periods, strict=True):
        seconds[name] = profile.samples * period
        peaks[name] = profile.peak_speed / (period * axes[name].config.counts_per_radian)
        moves[name] = AxisMove(finals[name], Profile(profile.acceleration, profile.speed))
    return MovePlan(
        targets=dict(targets),
        finals={name: axes[name].to_angle(final) for name, final in finals.items()},
        seconds=seconds,
        peak_speeds=peaks,
        early=tuple(names[i] for i in early),
        details={name: {"final_counts": final} for name, final in finals.items()},
        device=moves,
    )


def starts(axes: Mapping[str, Axis], plan: MovePlan, ended: Mapping[str, float]) -> dict[str, float]:
    """When each joint began: its board's first stamp of a profile's end less the length that the page gives it."""
    boards: dict[int, float] = {}
    for name, time in ended.items():
        if not math.isnan(time):
            boards.setdefault(axes[name].board.address, time - plan.seconds[name])
    return {
        name: boards[axes[name].board.address] for name in plan.finals if axes[name].board.address in boards
    }
