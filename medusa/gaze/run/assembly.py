"""A gaze put together from words: which controller, which coordination, which target."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from medusa.errors import CommandError
from medusa.gaze.coordination import COORDINATIONS
from medusa.gaze.pid import TABLE_6_4
from medusa.gaze.predictive_gaze import PredictiveGaze, PredictiveSettings
from medusa.gaze.retina import Detector
from medusa.gaze.run.loop import Gaze, LoopSettings, gaze_limits, least_speeds
from medusa.gaze.thesis_gaze import ThesisGaze, ThesisSettings
from medusa.head.drive import JointTraits
from medusa.kinematics import HeadGeometry, Joints, direction_of, look_at
from perception.target import Image, PatchTarget, Shape, Target, detect_bright_target

Controller = Literal["predictive", "thesis"]
CONTROLLERS: tuple[Controller, ...] = ("predictive", "thesis")
SHORTEST_PERIOD, LONGEST_PERIOD = 0.02, 0.04
SACCADE_ERROR = math.radians(5.0)


@dataclass(frozen=True)
class GazeChoice:
    """What the command line asks for; `frame_rate` in pictures a second."""

    frame_rate: float
    controller: str = "predictive"
    gains: str = "iv"
    coordination: str = "i"
    microsaccades: bool = True

    def __post_init__(self) -> None:
        for value, allowed, what in (
            (self.controller, CONTROLLERS, "controller"),
            (self.gains, tuple(TABLE_6_4), "column of table 6.4"),
            (self.coordination, tuple(COORDINATIONS), "coordination"),
        ):
            if value not in allowed:
                raise CommandError(f"there is no {what} {value!r}; there is {', '.join(allowed)}")
        if not 0.1 <= self.frame_rate <= 1000.0:
            raise CommandError(f"{self.frame_rate:g} pictures a second: must be 0.1 to 1000")

    @property
    def command_period(self) -> float:
        """Four looks at the head a picture, but 25 to 50 a second [s]."""
        return min(max(0.25 / self.frame_rate, SHORTEST_PERIOD), LONGEST_PERIOD)

    @property
    def pair_bound(self) -> float:
        """Pictures exposed at most so far apart are a pair: free-running cameras are up to half a period [s]."""
        return min(0.03, 0.45 / self.frame_rate)

    def make_gaze(self, traits: Mapping[str, JointTraits], geometry: HeadGeometry) -> Gaze:
        """The behaviour, within what the joints' traits allow."""
        way = COORDINATIONS[self.coordination]
        if self.controller == "predictive":
            # Two and a half pictures without the target are a loss, not a gap.
            patience = max(0.5, 2.5 / self.frame_rate)
            settings = PredictiveSettings(self.command_period, patience=patience, coordination=way)
            return PredictiveGaze(settings, geometry, gaze_limits(traits))
        return ThesisGaze(
            ThesisSettings(
                1.0 / self.frame_rate, least_speeds(traits), TABLE_6_4[self.gains], SACCADE_ERROR, way,
                self.microsaccades,
            ),
            gaze_limits(traits),
        )  # fmt: skip

    def loop_settings(self, traits: Mapping[str, JointTraits], geometry: HeadGeometry) -> LoopSettings:
        """How often the loop looks, and where it searches: a raster around straight ahead, within the limits."""
        limits = gaze_limits(traits)
        search = []
        for azimuth, elevation in ((0, 0), (25, 0), (-25, 0), (-25, 15), (25, 15), (25, -15), (-25, -15)):
            a, e = math.radians(azimuth), math.radians(elevation)
            point = 1.5 * direction_of(a, e)
            search.append(limits.confine(look_at(geometry, point, a))[0])
        return LoopSettings(
            command_period=self.command_period,
            pair_bound=self.pair_bound,
            pair_patience=self.pair_bound,
            too_late=max(0.6, 2.0 / self.frame_rate),
            search=tuple(search),
            search_after=max(1.0, 3.0 / self.frame_rate),
        )


def bright_detectors(
    threshold: int, *, size: int = 64, shape: Shape | None = None
) -> tuple[Detector, Detector]:
    """The thesis's bright target for both eyes, gated by shape where asked to."""

    def detect(image: Image) -> Target | None:
        return detect_bright_target(image, threshold, size=size, shape=shape)

    return detect, detect


def patch_detectors(patch: Image) -> tuple[Detector, Detector]:
    """A textured target for both eyes; each remembers where it saw it last. Raises CommandError."""
    try:
        return PatchTarget(patch).detect, PatchTarget(patch).detect
    except ValueError as error:
        raise CommandError(str(error)) from error


def straight_ahead(geometry: HeadGeometry, distance: float = 1.5) -> Joints:
    """Joint angles that look straight ahead at a distance [m]."""
    return look_at(geometry, distance * direction_of(0.0, 0.0), 0.0)
