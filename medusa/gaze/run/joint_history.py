"""Where the joints stood at a moment in the recent past: a picture's exposure."""

from bisect import bisect_left
from collections import deque

from medusa.kinematics import Joints


class JointHistory:
    """Joint angles by time, interpolated linearly; the last `length` looks are kept."""

    def __init__(self, length: int = 64) -> None:
        self._times: deque[float] = deque(maxlen=length)
        self._joints: deque[Joints] = deque(maxlen=length)

    def add(self, time: float, joints: Joints) -> None:
        """Take in a look; one that is not later than the last is dropped."""
        if not self._times or time > self._times[-1]:
            self._times.append(time)
            self._joints.append(joints)

    def at(self, moment: float) -> Joints | None:
        """The joint angles at a moment; None before the first look.

        Between two looks they are interpolated; after the last one they go on at the rate of the last two,
        since a picture may be known before the next look.
        """
        if not self._times or moment < self._times[0]:
            return None
        if len(self._times) == 1:
            return self._joints[0]
        after = min(max(bisect_left(self._times, moment), 1), len(self._times) - 1)
        start, end = self._times[after - 1], self._times[after]
        share = (moment - start) / (end - start)
        return Joints(
            *(a + share * (b - a) for a, b in zip(self._joints[after - 1], self._joints[after], strict=True))
        )
