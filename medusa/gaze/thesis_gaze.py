"""The gaze controller of the thesis: a saccade when the target is far, PID pursuit when near, a step a picture."""

import math
from dataclasses import dataclass, field

from medusa.gaze.command import Command, GazeLimits, Hold, Position, Pursue, Saccade, Sighting, Velocity
from medusa.gaze.coordination import Coordination, EyesFirst, coordinate, gaze_azimuth
from medusa.gaze.pid import Gains
from medusa.gaze.pursuit import JointPursuit
from medusa.kinematics import Joints, retinal_errors


@dataclass(frozen=True)
class ThesisSettings:
    """frame_period [s]; least_speed [rad/s] per axis; saccade_error [rad]: a retinal error above it is jumped at."""

    frame_period: float
    least_speed: Joints
    gains: Gains
    saccade_error: float
    coordination: Coordination = field(default_factory=EyesFirst)
    microsaccades: bool = False


class ThesisGaze:
    """Simplified kinematics (6.24), (6.25), coordination 6.5.3, saccades by position, PID pursuit by velocity."""

    def __init__(self, settings: ThesisSettings, limits: GazeLimits) -> None:
        self._settings, self._limits = settings, limits
        self._pursuits = {
            name: JointPursuit(
                settings.gains, settings.frame_period, least, microsaccades=settings.microsaccades
            )
            for name, least in settings.least_speed.as_axes().items()
        }

    def step(self, now: float, joints: Joints, sighting: Sighting | None) -> Command | None:
        """Decide on a new sighting; between sightings (None) the last command goes on, and None is returned.

        A picture without the target holds the head still: a velocity goes on for ever, so nothing may be left
        running blind.
        """
        if sighting is None:
            return None
        if not sighting.seen:
            self.saccade_ended(now)
            return Hold("the target is not seen")
        left, right, tilt = retinal_errors(sighting.left, sighting.right)
        # An eye that does not see the target goes along with the one that does.
        left_error = left if left is not None else right
        right_error = right if right is not None else left
        if left_error is None or right_error is None or tilt is None:
            raise AssertionError("a sighting that was seen has errors")
        at = sighting.joints
        centring = Joints(at.pan, at.tilt + tilt, at.left + left_error, at.right + right_error)
        way = self._settings.coordination
        neck = way.wants_neck_saccade(at.pan, gaze_azimuth(centring))
        wanted, limited = self._limits.confine(coordinate(way, centring, at_once=neck))
        if neck or max(abs(left_error), abs(right_error), abs(tilt)) > self._settings.saccade_error:
            return Saccade(wanted, "neck to a comfortable position" if neck else "target far from the fovea")
        errors = Joints(*(w - a for w, a in zip(wanted, at, strict=True))).as_axes()
        angles, speeds = at.as_axes(), self._limits.speed.as_axes()
        commands: dict[str, Velocity | Position] = {}
        for name, pursuit in self._pursuits.items():
            command = pursuit.step(errors[name], angles[name])
            fastest = speeds[name]
            if isinstance(command, Velocity) and abs(command.rate) > fastest:
                # At high frame rates K_P e/T_v can exceed what the joint may do.
                command, limited = Velocity(math.copysign(fastest, command.rate)), limited | {name}
            commands[name] = command
        return Pursue(commands, limited)

    def saccade_ended(self, now: float) -> None:
        """The eyes have landed: what the PIDs summed before is invalid."""
        for pursuit in self._pursuits.values():
            pursuit.reset()
