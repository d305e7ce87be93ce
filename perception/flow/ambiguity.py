"""Which of several shifts that fit a window is the true one: what frames at other distances say.

Every shift means a distance, and a distance a shift from every other frame. The right one correlates in all of them,
another period of a pattern only by chance; unless the pattern moves by a whole period from frame to frame, and then
nothing can tell but a bound on the distance.
"""

from math import ceil, floor, isfinite

from perception.flow.geometry import Ray
from perception.flow.key_frames import Candidate, KeyFrames, nearest_to
from perception.flow.search import Search, search
from perception.flow.strip import Strip
from perception.flow.window import Window

PARTS = (0.15, 0.38, 0.62, 0.8)
"""The frames asked are these parts of the way back to the first one, as far as there are any."""
CLEAR = 0.65
"""No other shift may correlate by this part as well as the best one, all frames together."""
WELL = 0.7
"""Several shifts that all correlate by less are noise's or those of stripes too fine for the coarse image."""
SLACK_PX = 1.5
"""A shift may be this far outside those of the nearest and of infinitely far walls."""


def tell_apart(
    now: Strip,
    window: Window,
    ray: Ray,
    frames: KeyFrames,
    first: Candidate,
    found: Search,
    candidates: list[Candidate],
    nearest_m: float,
    farthest_px: float,
) -> float | None:
    """The one of the shifts `found` that is a wall's at least `nearest_m` away, and that other frames confirm.

    None when they leave it open.

    Args:
        first: of the candidates among the frames, that on which they were found.
        farthest_px: shifts beyond are not looked for.
    """
    if found.broad or float(found.scores.max()) < WELL:
        return None
    motion = frames.motion_since(first.frame)
    least, most = ray.flow_range(nearest_m, farthest_px, motion)
    peaks = [p for p in found.peaks if least - SLACK_PX <= p <= most + SLACK_PX]
    if len(peaks) < 2:
        return peaks[0] if peaks else None
    depths = [ray.estimate_inverse_depth(p, 0.0, motion)[0] for p in peaks]
    rest = [c for c in candidates if c is not first]
    others = [nearest_to(rest, part * abs(first.parallax_px)) for part in PARTS]
    sums = [found.score(p) for p in peaks]
    asked = {id(c): c for c in others if c is not None}
    for other in asked.values():
        motion = frames.motion_since(other.frame)
        shifts = [ray.predict_flow(depth, motion)[0] for depth in depths]
        if not all(isfinite(s) for s in shifts):
            return None
        ends = [min(max(s, -farthest_px), farthest_px) for s in (min(shifts), max(shifts))]
        again = search(now, other.frame.strip, window, floor(ends[0]) - 2, ceil(ends[1]) + 2)
        sums = [total + again.score(s) for total, s in zip(sums, shifts, strict=True)]
    second, best = sorted(sums)[-2:]
    return peaks[sums.index(best)] if asked and second < CLEAR * best else None
