"""A saccade: joints that jump together and arrive together.

Every joint's trapezoid is stretched to the time of the slowest, so that all end in the same sample of their board;
all are armed before the boards' STARTs leave in one write. "Done" means arrived and settled, not that F0 cleared.
"""

import asyncio
import logging
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

from medusa.errors import CommandError
from medusa.head.moves import MoveReport, Speeds
from medusa.kinematics import eyes_from_version
from medusa.mc3000.board import Mode
from medusa.mc3000.joint import VELOCITY_MODES
from medusa.servo.profiles import Trapezoid, stretch_together

if TYPE_CHECKING:
    from medusa.head.joint_group import Head
    from medusa.head.snapshots import HeadSnapshot
    from medusa.mc3000.axis import Axis

log = logging.getLogger(__name__)

EYES = ("left_vergence", "right_vergence")


@dataclass(frozen=True)
class SaccadePlan:
    """The profiles of a saccade before it begins; chip's units, s."""

    targets: dict[str, float]
    """rad."""
    profiles: dict[str, Trapezoid]
    periods: dict[str, float]
    scales: dict[str, float]
    """Counts per radian, positive."""
    early: tuple[str, ...]
    """Joints too near to be stretched: they end before the others."""

    @property
    def seconds(self) -> float:
        """From START to the last command of the last joint, s."""
        return max((p.samples * self.periods[n] for n, p in self.profiles.items()), default=0.0)

    def peak_speed(self, name: str) -> float:
        """Greatest speed that a joint's profile reaches, rad/s."""
        return self.profiles[name].peak_speed / (self.periods[name] * self.scales[name])

    def speeds(self, axes: Mapping[str, "Axis"]) -> dict[str, Speeds]:
        """Acceleration and speed of each joint that make the board take exactly these profiles."""
        wanted = {}
        for name, profile in self.profiles.items():
            if profile.distance == 0:
                continue
            config, period, scale = axes[name].config, self.periods[name], self.scales[name]
            # A register may lie just above the configured value it was rounded from; that one gives it again.
            wanted[name] = Speeds(
                acceleration=min(profile.acceleration / 256 / (scale * period**2), config.acceleration),
                max_speed=min(profile.speed / (scale * period), config.max_speed),
            )
        return wanted


@dataclass(frozen=True)
class SaccadeReport:
    """How a saccade went."""

    plan: SaccadePlan
    move: MoveReport

    @property
    def settled(self) -> bool:
        """Every joint rests within its configured settle_counts of its target."""
        return all(self.move.settled.values())

    @property
    def end_skew(self) -> float:
        """Between the first and the last end of those profiles that were to end together, s; NaN if unheard."""
        ends = [t for n, t in self.move.ended.items() if n not in self.plan.early and not math.isnan(t)]
        return max(ends) - min(ends) if ends else math.nan


def saccade_targets(
    now: Mapping[str, float],
    *,
    pan: float | None = None,
    tilt: float | None = None,
    version: float | None = None,
    vergence: float | None = None,
) -> dict[str, float]:
    """Joint angles (rad) for what is given; version = (l + r)/2 and vergence = r − l keep their present value.

    `now`: present command angles by joint. CommandError when nothing is given or vergence is negative: eyes that
    look apart.
    """
    if all(value is None for value in (pan, tilt, version, vergence)):
        raise CommandError("nowhere to look: give pan, tilt, version or vergence")
    targets = {name: value for name, value in (("pan", pan), ("tilt", tilt)) if value is not None}
    if version is not None or vergence is not None:
        left, right = (now[name] for name in EYES)
        if vergence is not None and vergence < 0:
            raise CommandError(
                f"a vergence of {math.degrees(vergence):g}° is below 0: the eyes would look apart"
            )
        targets |= dict(
            zip(
                EYES,
                eyes_from_version(
                    (left + right) / 2 if version is None else version,
                    right - left if vergence is None else vergence,
                ),
                strict=True,
            )
        )
    return targets


def plan_saccade(
    axes: Mapping[str, "Axis"], targets: Mapping[str, float], snapshot: "HeadSnapshot"
) -> SaccadePlan:
    """Profiles to `targets` (rad) from the command positions of `snapshot`, stretched to end together.

    CommandError for a target outside the soft limits, or a joint that is not homed or not in position mode.
    """
    originals: dict[str, Trapezoid] = {}
    periods: dict[str, float] = {}
    for name, angle in targets.items():
        if name not in axes:
            raise CommandError(f"there is no joint {name!r}; the head has {', '.join(axes)}")
        axis = axes[name]
        registers = axis.check_move(angle, None, None)
        distance = axis.to_counts(angle) - snapshot.joints[name].command_counts
        originals[name] = Trapezoid(distance, registers.acceleration_256, registers.maximum)
        periods[name] = axis.sample_period(Mode.POSITION)
    stretched, early = stretch_together(originals.values(), periods.values())
    names = list(originals)
    return SaccadePlan(
        targets=dict(targets),
        profiles=dict(zip(names, stretched, strict=True)),
        periods=periods,
        scales={name: axes[name].config.counts_per_radian for name in names},
        early=tuple(names[i] for i in early),
    )


async def saccade(head: "Head", targets: Mapping[str, float]) -> SaccadeReport:
    """Jump with the named joints to their angles (rad) and wait until all have arrived and settled.

    Raises CommandError before anything moves, HeadFault when something stops the head on the way. A joint that
    did not settle is named in the report and in the log.
    """
    axes = [head.axes[name] for name in targets if name in head.axes]
    await asyncio.gather(*(axis.set_mode(Mode.POSITION) for axis in axes if axis.mode in VELOCITY_MODES))
    plan = plan_saccade(head.axes, targets, await head.snapshot())
    if plan.early:
        log.warning("%s: too near to be stretched, ends early", ", ".join(plan.early))
    return SaccadeReport(plan, await head.move(targets, plan.speeds(head.axes)))
