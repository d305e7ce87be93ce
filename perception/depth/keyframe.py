"""The one picture that is kept."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.depth.geometry.motion import Motion
from perception.depth.match.view import View


@dataclass
class Kept:
    """The kept picture and the motion from it to the newest one, as it was given and as it was corrected; and what
    the camera has moved since it last measured."""

    view: View
    given: Motion = field(default_factory=Motion.identity)
    corrected: Motion = field(default_factory=Motion.identity)
    unmeasured: Motion = field(default_factory=Motion.identity)
    seen_from: NDArray[np.float64] | None = None
    """Where the other picture of the last pair that this one was in stood, in this one's frame, m."""

    def advance(self, motion: Motion, anchored: bool) -> None:
        """The next picture; its motion is from the kept one when anchored, from the one before otherwise."""
        self.given = motion if anchored else self.given.then(motion)
        self.unmeasured = motion if anchored else self.unmeasured.then(motion)

    def correct(self, corrected: Motion) -> Motion:
        """Take the corrected motion from the kept picture to the newest; what it makes of the motion to step by."""
        step = self.corrected.inverse().then(corrected)
        self.corrected = corrected
        return step

    def likeness(self, pair: Motion) -> float:
        """Cosine of the angle between the baselines of the last pair and of this one, along which the noise of the
        kept picture errs in both; 0 for the first. `pair` is the motion from the kept picture."""
        before, now = self.seen_from, pair.inverse().translation
        self.seen_from = now
        if before is None:
            return 0.0
        return float(before @ now) / max(float(np.linalg.norm(before) * np.linalg.norm(now)), 1e-12)
