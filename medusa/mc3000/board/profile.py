"""The board's trapezoidal profile in closed form (docs/protocols, MC3000: "The profile, ours")."""

import math
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.mc3000.board.registers import FilterBytes

MAX_SPEED_COUNTS = 127
MAX_ACCELERATION_256 = 0x7FFF


@dataclass(frozen=True)
class Profile:
    """PROFILE as the board takes it: acceleration in 1/256 count/sample², speed in counts/sample."""

    acceleration_256: int
    maximum: int

    @property
    def acceleration(self) -> float:
        """Acceleration, counts/sample²."""
        return self.acceleration_256 / 256


def make_profile(
    acceleration_counts_s2: float, speed_counts_s: float, filter_: FilterBytes, clock_hz: int
) -> Profile:
    """The nearest profile that the chip can run at this sample period.

    Raises CommandError with the number in the way: a speed above 127 counts a sample or below
    half a count a sample, an acceleration above 7FFFH/256 or below 1/512 count/sample².
    """
    period = filter_.sample_period(clock_hz)
    speed = speed_counts_s * period
    acceleration = acceleration_counts_s2 * period**2 * 256
    if not 0.5 <= speed <= MAX_SPEED_COUNTS:
        limit = MAX_SPEED_COUNTS if speed > MAX_SPEED_COUNTS else 0.5
        raise CommandError(
            f"a speed of {speed_counts_s:.1f} counts/s is {speed:.2f} counts a sample at T={filter_.T};"
            f" the chip can do 1 to {MAX_SPEED_COUNTS}: a sample period of"
            f" {1e3 * limit / speed_counts_s:.3f} ms would allow it"
            if speed_counts_s > 0
            else f"a speed of {speed_counts_s:.1f} counts/s moves nothing; it must be above 0"
        )
    if not 0.5 <= acceleration <= MAX_ACCELERATION_256:
        raise CommandError(
            f"an acceleration of {acceleration_counts_s2:.1f} counts/s² is {acceleration:.2f}/256"
            f" count/sample² at T={filter_.T}; the chip can do 1/256 to {MAX_ACCELERATION_256}/256"
        )
    return Profile(round(acceleration), round(speed))


def profile_samples(distance_counts: int, profile: Profile) -> float:
    """Samples N from the start to the final position, N = D/v_p + n_a (0 for no distance).

    n_a = min(v/a, √(D/a)) samples of acceleration, v_p = a n_a the peak speed. The command is the final
    position, and F0 clears, at the first whole sample n ≥ N.
    """
    distance = abs(distance_counts)
    if distance == 0:
        return 0.0
    rising = min(profile.maximum / profile.acceleration, math.sqrt(distance / profile.acceleration))
    return distance / (profile.acceleration * rising) + rising
