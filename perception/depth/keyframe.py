"""The keyframe: the one image that is kept, and the motion since."""

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth.match.view import View


@dataclass
class Keyframe:
    """The kept image, the motion from it to the newest one as given and as corrected, and the motion since the last
    measurement."""

    view: View
    given: Motion = field(default_factory=Motion.identity)
    corrected: Motion = field(default_factory=Motion.identity)
    unmeasured: Motion = field(default_factory=Motion.identity)
    seen_from: NDArray[np.float64] | None = None
    """The other camera's position in the last pair of this image, in this image's frame, m."""

    def advance(self, motion: Motion, anchored: bool) -> None:
        """Count the next image; its motion is from the keyframe when anchored, from the image before otherwise."""
        self.given = motion if anchored else self.given.then(motion)
        self.unmeasured = motion if anchored else self.unmeasured.then(motion)

    def correct(self, corrected: Motion) -> Motion:
        """Take the corrected motion from the keyframe to the newest image; the step that it makes of the last one."""
        step = self.corrected.inverse().then(corrected)
        self.corrected = corrected
        return step

    def baseline_cosine(self, pair: Motion) -> float:
        """Cosine of the angle between the baselines of the last pair and of this one, along which the noise of the
        keyframe errs in both; 0 for the first. `pair` is the motion from the keyframe."""
        before, now = self.seen_from, pair.inverse().translation
        self.seen_from = now
        if before is None:
            return 0.0
        return float(before @ now) / max(float(np.linalg.norm(before) * np.linalg.norm(now)), 1e-12)
