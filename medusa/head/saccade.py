"""Where a saccade goes: joint angles for what is given of pan, tilt, version and vergence.

`JointGroup.move(targets, together=True)` is the saccade itself: profiles stretched to the time of the slowest joint,
so that all arrive at once.
"""

import math
from collections.abc import Mapping

from medusa.errors import CommandError
from medusa.kinematics import eyes_from_version

EYES = ("left_vergence", "right_vergence")


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
        eyes = eyes_from_version(
            (left + right) / 2 if version is None else version,
            right - left if vergence is None else vergence,
        )
        targets |= dict(zip(EYES, eyes, strict=True))
    return targets
