"""The square: driven both ways, recorded, calibrated from, and driven again by the calibrated odometry."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import atan2, hypot, inf, pi

from labmate.base.mobile_base import MobileBase
from labmate.base.reading import BaseReading
from labmate.calibration import (
    DIRECTIONS,
    Calibration,
    Closing,
    Direction,
    Run,
    closing_of,
    estimate_closed_form,
    refine_on_tracks,
)
from labmate.odometry import START, Odometry, OdometryNoise, Pose, WheelGeometry, wrapped
from medusa.errors import CommandError

TruePose = Callable[[], Pose]
"""Where the base really is now, in any fixed frame."""

_NO_NOISE = OdometryNoise(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Progress:
    """How far a square is: leg `done` of `of` has just ended, or is under way when a reading comes along."""

    direction: Direction
    calibrated: bool
    done: int
    of: int
    reading: BaseReading


@dataclass(frozen=True, slots=True)
class SquareRun:
    """One square as driven: encoder counts on the way and, where there is a witness, the true way.

    `true_path` is in the frame of the run's start and belongs, entry by entry, to `track`.
    """

    direction: Direction
    calibrated: bool
    side: float
    seconds: float
    track: tuple[tuple[int, int], ...]
    true_path: tuple[Pose, ...] | None

    def ended_at(self, true_end: Pose) -> Run:
        """The run as a calibration takes it."""
        return Run(self.direction, self.track, true_end)

    def path(self, geometry: WheelGeometry) -> list[Pose]:
        """The odometry's poses along the track."""
        odometry = Odometry(geometry, _NO_NOISE)
        return [odometry.step(left, right) for left, right in self.track]


@dataclass(frozen=True, slots=True)
class SquareResult:
    """The whole experiment: both ways by the base's own geometry, the calibration, both ways by that."""

    side: float
    nominal: WheelGeometry
    calibration: Calibration
    uncalibrated: tuple[SquareRun, ...]
    calibrated: tuple[SquareRun, ...]

    def closing(self, run: SquareRun) -> Closing:
        """Closing error of a run against the odometry by which it was driven."""
        geometry = self.nominal
        if run.calibrated:
            geometry = self.calibration.geometry(self.nominal.counts_per_metre)
        return closing_of(run.ended_at(true_end(run)), geometry)


def true_end(run: SquareRun) -> Pose:
    """Where a witnessed run ended, from its start."""
    if run.true_path is None:
        raise CommandError(f"nobody saw where the {run.direction} run ended: measure it")
    return run.true_path[-1]


def aim(pose: Pose, corner: tuple[float, float], drift: float) -> tuple[float, float]:
    """Heading to take (rad) and way to GO (m) so that an arc of curvature `drift` (rad/m) ends on the corner.

    The chord of an arc s is s sin(κs/2)/(κs/2) and points κs/2 off its first tangent; to third order in κ d,
    s = d (1 + (κ d)²/24).
    """
    dx, dy = corner[0] - pose.x, corner[1] - pose.y
    distance = hypot(dx, dy)
    way = distance * (1.0 + (drift * distance) ** 2 / 24.0)
    return atan2(dy, dx) - 0.5 * drift * way, way


async def drive_square(
    base: MobileBase,
    direction: Direction,
    side: float,
    *,
    calibration: Calibration | None = None,
    true_pose: TruePose | None = None,
    progress: Callable[[Progress], None] | None = None,
) -> SquareRun:
    """Drive a square of `side` m, the first side straight ahead, and back to the first heading.

    Without a calibration: four times GO side, TURN ±90°, as UMBmark asks. With one, the calibrated odometry
    aims at each corner, and a TURN is scaled by b/b_n since the base turns by its own wheel base.
    """
    if not 0.1 <= side <= 20.0:
        raise CommandError(f"the square's side must be 0.1 to 20 m, it is {side:g} m")
    sign = 1.0 if direction == "ccw" else -1.0
    track: list[tuple[int, int]] = []
    true_path: list[Pose] = []
    nominal = base.wheels
    geometry = base.geometry
    if calibration is not None:
        geometry = calibration.geometry(nominal.counts_per_metre)
    odometry = Odometry(geometry, _NO_NOISE)
    legs = 8 if calibration is None else 9
    done = 0
    origin = true_pose() if true_pose is not None else START

    def record(reading: BaseReading) -> None:
        if reading.counts is None:
            return
        counts = (reading.counts.left, reading.counts.right)
        if not track or track[-1] != counts:
            track.append(counts)
            odometry.step(*counts)
            if true_pose is not None:
                true_path.append(true_pose().seen_from(origin))
        if progress is not None:
            progress(Progress(direction, calibration is not None, done, legs, reading))

    forget = base.observe(record)
    try:
        started = (await base.read()).time
        if calibration is None:
            for _ in range(4):
                await base.go(side)
                done += 1
                await base.turn(sign * 0.5 * pi)
                done += 1
        else:
            turn_scale = calibration.wheel_base / nominal.wheel_base
            for corner in ((side, 0.0), (side, sign * side), (0.0, sign * side), (0.0, 0.0)):
                heading, way = aim(odometry.pose, corner, geometry.drift)
                await base.turn(turn_scale * wrapped(heading - odometry.pose.heading))
                done += 1
                await base.go(way)
                done += 1
            await base.turn(turn_scale * wrapped(-odometry.pose.heading))
            done += 1
        ended = await base.read()
    finally:
        forget()
    if true_pose is not None:
        # The last new counts may have been read a moment before the base came to rest.
        true_path[-1] = true_pose().seen_from(origin)
    return SquareRun(
        direction,
        calibration is not None,
        side,
        ended.time - started,
        tuple(track),
        tuple(true_path) if true_pose is not None else None,
    )


def calibrate(
    runs: Sequence[tuple[SquareRun, Pose]], nominal: WheelGeometry, measured_deviation: float
) -> Calibration:
    """Calibrate from runs and their true ends (several a direction are averaged), m.

    The closed form gives the start and the deviations, the recorded tracks the last tenth of a millimetre.
    """
    side = runs[0][0].side if runs else inf
    closings = [closing_of(run.ended_at(end), nominal) for run, end in runs]
    start = estimate_closed_form(closings, side, nominal, measured_deviation)
    return refine_on_tracks([run.ended_at(end) for run, end in runs], start, nominal.counts_per_metre)


async def run_experiment(
    base: MobileBase,
    side: float,
    true_pose: TruePose,
    *,
    witness_deviation: float = 1e-3,
    progress: Callable[[Progress], None] | None = None,
) -> SquareResult:
    """Both ways, calibrate, both ways again. `witness_deviation`: how well `true_pose` is known, m."""
    uncalibrated = [
        await drive_square(base, direction, side, true_pose=true_pose, progress=progress)
        for direction in DIRECTIONS
    ]
    nominal = base.wheels
    found = calibrate([(run, true_end(run)) for run in uncalibrated], nominal, witness_deviation)
    calibrated = [
        await drive_square(base, direction, side, calibration=found, true_pose=true_pose, progress=progress)
        for direction in DIRECTIONS
    ]
    return SquareResult(side, nominal, found, tuple(uncalibrated), tuple(calibrated))
