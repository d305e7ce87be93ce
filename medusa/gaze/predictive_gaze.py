"""A gaze controller that knows its own delay: the target is followed where it will be when the command acts.

The retinal error alone is old by the time it is known, and it mixes the target's motion with the head's own.
Here the joint angles at the exposure take the head's motion out: what is left is the target's bearing in the
head frame, which three constant-velocity Kalman filters (azimuth, elevation, inverse distance) carry forward
to the moment a command acts. The head follows that path in integral velocity mode, many commands a picture,
each aiming at where the path will be at its end.
"""

import math
from dataclasses import dataclass, field

import numpy as np

from medusa.gaze.command import Command, GazeLimits, Hold, Pursue, Saccade, Sighting, Velocity
from medusa.gaze.coordination import Coordination, EyesFirst
from medusa.gaze.prediction import ConstantVelocityFilter
from medusa.kinematics import (
    HeadGeometry,
    Joints,
    Vector,
    bearing_of,
    direction_of,
    line_of_sight,
    look_at,
    triangulate,
)

# Nearer than this the eyes cannot converge: 45° each at a baseline of 0.2 m.
_NEAREST = 0.12


@dataclass(frozen=True)
class PredictiveSettings:
    """What the predictive gaze is tuned by.

    command_period: time between commands [s]. acceleration: spectral density of the target's angular
    acceleration [rad²/s³]. approach: the same for its inverse distance [1/(m² s³)]. servo_lag: how far an
    axis is behind its command, 1/K_v [s]. agility: how far the acceleration may adapt, as multiples.
    acquire: a new target is jumped at while its predicted error is above this [rad]. catch_up: so is one
    already followed above this; a smaller error is sooner made good by pursuit, which sees on the way.
    landing_delay: how much later than its profile a saccade is thought to end at first [s]. blind_angle: an
    unseen target is followed blind over this angle at most [rad]. patience: and for so long [s]. distance:
    assumed while only one eye sees the target and nothing is known of it [m].
    """

    command_period: float
    acceleration: float = 0.1
    approach: float = 0.05
    servo_lag: float = 1 / 170
    action_delay: float = 0.01
    stiffness: float = 25.0
    agility: tuple[float, float] = (0.02, 10.0)
    acquire: float = 0.05
    catch_up: float = 0.22
    landing_delay: float = 0.15
    blind_angle: float = 0.1
    patience: float = 0.5
    distance: float = 1.5
    coordination: Coordination = field(default_factory=EyesFirst)


class PredictiveGaze:
    """Kalman prediction of the target's bearing, full inverse kinematics, catch-up saccades."""

    def __init__(self, settings: PredictiveSettings, geometry: HeadGeometry, limits: GazeLimits) -> None:
        self._settings, self._geometry, self._limits = settings, geometry, limits
        self._azimuth = ConstantVelocityFilter(settings.acceleration, agility=settings.agility)
        self._elevation = ConstantVelocityFilter(settings.acceleration, agility=settings.agility)
        self._nearness = ConstantVelocityFilter(settings.approach, agility=settings.agility)
        self._landed = -math.inf
        self._landing_delay = settings.landing_delay
        self._acquired = False
        self._expected_landing: float | None = None
        self._rates = Joints(0.0, 0.0, 0.0, 0.0)

    def step(self, now: float, joints: Joints, sighting: Sighting | None) -> Command:
        """Decide at `now`, the axes' command angles being `joints`; a sighting is taken in when there is a new one."""
        if sighting is not None:
            if sighting.seen:
                self._take_in(sighting)
            else:
                self._take_in_unseen(sighting)
        seen = self._azimuth.stamp
        if seen is None:
            return Hold("no target has been seen")
        if now - max(seen, self._landed) > self._settings.patience:
            self._rates = Joints(0.0, 0.0, 0.0, 0.0)
            self.forget()
            return Hold(f"the target has not been seen for {self._settings.patience:g} s")
        period, lag = self._settings.command_period, self._settings.servo_lag
        acting = now + self._settings.action_delay
        ahead = Joints(
            *(q + r * self._settings.action_delay for q, r in zip(joints, self._rates, strict=True))
        )
        here, limited = self._limits.confine(self._wanted(acting + lag, joints))
        azimuth = self._azimuth.predict(now).value
        # One jump a look: where a blind head only thinks that the target went on, it does not jump again.
        if seen > self._landed:
            if self._settings.coordination.wants_neck_saccade(joints.pan, azimuth):
                return self._saccade(now, joints, azimuth, "neck to a comfortable position")
            error = max(abs(w - q) for w, q in zip(here[1:], ahead[1:], strict=True))
            self._acquired |= error <= self._settings.acquire
            least = self._settings.catch_up if self._acquired else self._settings.acquire
            if error > least and not (self._acquired and self._too_fast(now, error)):
                return self._saccade(now, joints, None, "target ahead of the fovea")
        there, _ = self._limits.confine(self._wanted(acting + period + lag, joints))
        stiffness = self._settings.stiffness
        self._rates = Joints(
            *(
                min(max((later - w) / period + stiffness * (w - q), -speed), speed)
                for later, w, q, speed in zip(there, here, ahead, self._limits.speed, strict=True)
            )
        )
        return Pursue({name: Velocity(rate) for name, rate in self._rates.as_axes().items()}, limited)

    def saccade_ended(self, now: float) -> None:
        """The eyes have landed: nothing was seen on the way, so patience begins anew; the filters just go on."""
        if self._expected_landing is not None:
            late = min(max(now - self._expected_landing, 0.0), 0.5)
            self._landing_delay += 0.5 * (late - self._landing_delay)
            self._expected_landing = None
        self._landed = now
        self._rates = Joints(0.0, 0.0, 0.0, 0.0)

    def forget(self) -> None:
        """Begin anew with the next sighting."""
        self._landed = -math.inf
        self._acquired = False
        for each in (self._azimuth, self._elevation, self._nearness):
            each.forget()

    def _take_in(self, sighting: Sighting) -> None:
        if self._azimuth.stamp is not None and sighting.stamp < self._azimuth.stamp:
            return  # a picture that was overtaken by a later one
        point, spread = self._place(sighting)
        azimuth, elevation = bearing_of(point)
        self._azimuth.update(sighting.stamp, azimuth, sighting.sigma)
        self._elevation.update(sighting.stamp, elevation, sighting.sigma)
        if sighting.left is not None and sighting.right is not None:
            self._nearness.update(sighting.stamp, 1 / float(np.linalg.norm(point)), spread)

    def _take_in_unseen(self, sighting: Sighting) -> None:
        """A picture without the target: where the path has already gone far on belief alone, it is given up.

        The target has turned, more likely than not, and is found again near where it was seen.
        """
        seen = self._azimuth.stamp
        if seen is None or sighting.stamp <= max(seen, self._landed):
            return
        filters = (self._azimuth, self._elevation)
        gone = math.hypot(*(f.predict(sighting.stamp).value - f.predict(seen).value for f in filters))
        if gone > self._settings.blind_angle:
            for each in filters:
                each.halt()

    def _place(self, sighting: Sighting) -> tuple[Vector, float]:
        """The target (3,) [m] in the head frame, and the standard deviation of its inverse distance [1/m]."""
        spread = sighting.sigma * 2**0.5 / self._geometry.baseline
        farthest = 50.0
        if sighting.left is not None and sighting.right is not None:
            point = triangulate(self._geometry, sighting.joints, sighting.left, sighting.right)
            if point is not None and float(np.linalg.norm(point)) < farthest:
                return point, spread
            lines = [
                line_of_sight(self._geometry, sighting.joints, "left", sighting.left)[1],
                line_of_sight(self._geometry, sighting.joints, "right", sighting.right)[1],
            ]
            mean = lines[0] + lines[1]
            return farthest * mean / float(np.linalg.norm(mean)), spread
        distance = self._distance(sighting.stamp)
        if sighting.left is not None:
            origin, direction = line_of_sight(self._geometry, sighting.joints, "left", sighting.left)
        elif sighting.right is not None:
            origin, direction = line_of_sight(self._geometry, sighting.joints, "right", sighting.right)
        else:
            raise AssertionError("only a sighting with a target is placed")
        # Where the line of sight is `distance` from the head's origin: |o + s d| = distance.
        along, beyond = float(origin @ direction), distance**2 - float(origin @ origin)
        return origin + direction * (math.sqrt(max(0.0, along**2 + beyond)) - along), spread

    def _distance(self, moment: float) -> float:
        if self._nearness.stamp is None:
            return self._settings.distance
        nearness = self._nearness.predict(max(moment, self._nearness.stamp)).value
        return 1 / min(max(nearness, 0.02), 1 / _NEAREST)

    def _wanted(self, moment: float, joints: Joints, pan: float | None = None) -> Joints:
        """Joint angles that fixate the target as predicted for a moment; pan by the coordination unless given."""
        moment = self._trusted(moment)
        azimuth = self._azimuth.predict(moment).value
        elevation = self._elevation.predict(moment).value
        point = self._distance(moment) * direction_of(azimuth, elevation)
        turned = self._settings.coordination.pan(joints.pan, azimuth) if pan is None else pan
        turned = min(max(turned, self._limits.low.pan), self._limits.high.pan)
        return look_at(self._geometry, point, turned)

    def _too_fast(self, now: float, error: float) -> bool:
        """Whether the target would be elsewhere, should it turn, by the time a saccade over `error` has landed."""
        rate = math.hypot(self._azimuth.predict(now).rate, self._elevation.predict(now).rate)
        blind = self._landing_delay + 2 * math.sqrt(error / min(self._limits.acceleration))
        return rate * blind > self._settings.catch_up

    def _trusted(self, moment: float) -> float:
        """How far ahead a path is believed: fully for as long as the patience, then ever less, for a quarter more.

        Nothing keeps its velocity for long, and a gaze that runs after a mere belief ends at a limit of
        travel.
        """
        seen = self._azimuth.stamp
        if seen is None:
            return moment
        sure, fading = self._settings.patience, 0.25 * self._settings.patience
        beyond = moment - seen - sure
        return moment if beyond <= 0 else seen + sure + fading * (1 - math.exp(-beyond / fading))

    def _saccade(self, now: float, joints: Joints, pan: float | None, reason: str) -> Saccade:
        """To where the target will be when the eyes have landed; how long that takes depends on that place.

        It begins when the pursuit has ended by its ramps, |q̇|/a, and ends later than its profile: it is armed,
        started and read back. That delay is learnt.
        """
        ramp = max(abs(rate) / a for rate, a in zip(self._rates, self._limits.acceleration, strict=True))
        duration = ramp
        target = joints
        for _ in range(3):
            moment = now + duration + self._landing_delay
            target, _ = self._limits.confine(self._wanted(moment, joints, pan))
            duration = ramp + self._limits.duration(joints, target)
        self._expected_landing = now + duration
        self._acquired = True
        return Saccade(target, reason)
