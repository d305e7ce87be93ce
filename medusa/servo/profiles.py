"""Trapezoidal profile and integral velocity, count for count as the chip steps them (docs/protocols).

All in the chip's units, in integers, so that no rounding of the host can differ from the formula:
D counts to go, a in 1/256 counts/sample², v in counts/sample. Thesis 6.4.3 and 6.4.4.
"""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.servo.limits import ACCELERATION_MAX, SPEED_MAX, AxisScale


@dataclass(frozen=True)
class Trapezoid:
    """A profile over `distance` counts (signed): `acceleration` in 1/256 counts/sample², `speed` a sample.

    With a and v in counts and samples: n_a = min(v/a, √(D/a)), v_p = a n_a, N = D/v_p + n_a; after n
    samples the command has gone ⌊s(n)⌋: s = a n²/2 up to n_a, then v_p a sample, from N − n_a on D − a (N −
    n)²/2.
    """

    distance: int
    acceleration: int
    speed: int

    def __post_init__(self) -> None:
        if not 1 <= self.acceleration <= ACCELERATION_MAX:
            raise CommandError(
                f"profile acceleration {self.acceleration}/256 counts/sample² is outside "
                f"1..{ACCELERATION_MAX}"
            )
        if not 1 <= self.speed <= SPEED_MAX:
            raise CommandError(f"profile speed {self.speed} counts/sample is outside 1..{SPEED_MAX}")

    @property
    def triangular(self) -> bool:
        """Half the distance comes before the greatest speed: v² ≥ a D."""
        return 256 * self.speed**2 >= self.acceleration * abs(self.distance)

    @property
    def peak_speed(self) -> float:
        """v_p, counts/sample."""
        if self.triangular:
            return math.sqrt(self.acceleration / 256 * abs(self.distance))
        return float(self.speed)

    @property
    def length(self) -> float:
        """N in samples, not yet rounded up: 2 √(D/a) or D/v + v/a."""
        distance, a = abs(self.distance), self.acceleration / 256
        return 2 * math.sqrt(distance / a) if self.triangular else distance / self.speed + self.speed / a

    @property
    def samples(self) -> int:
        """The first n ≥ N: the sample with the final command, where the chip clears F0."""
        distance, a, v = abs(self.distance), self.acceleration, self.speed
        if self.triangular:
            square = -(-1024 * distance // a)
            root = math.isqrt(square)
            return root if root * root == square else root + 1
        return -(-(distance * a + 256 * v * v) // (v * a))

    def command(self, n: int) -> int:
        """Signed counts that the command has gone n samples after the start (n = 0: the old command)."""
        distance, a, v = abs(self.distance), self.acceleration, self.speed
        if n <= 0:
            return 0
        if n >= self.samples:
            gone = distance
        elif self.triangular:
            if a * n * n <= 256 * distance:
                gone = a * n * n // 512
            else:
                gone = (-512 * distance - a * n * n + math.isqrt(4096 * n * n * a * distance)) // 512
        elif n * a <= 256 * v:
            gone = a * n * n // 512
        elif n * v <= distance:
            gone = (v * n * a - 128 * v * v) // a
        else:
            left = distance * a + 256 * v * v - n * v * a
            gone = distance - -(-left * left // (512 * v * v * a))
        return gone if self.distance >= 0 else -gone

    def commands(self) -> list[int]:
        """The whole profile, n = 0 … `samples`."""
        return [self.command(n) for n in range(self.samples + 1)]

    def to_go(self, n: int) -> int:
        """Samples until the final command."""
        return max(self.samples - n, 0)


class IntegralVelocity:
    """The command of mode 3: the internal velocity moves toward the commanded one by at most a.

    Position and velocity are kept to 1/256 counts; the command is the floor of the position.
    """

    def __init__(self, acceleration: int, position: int = 0) -> None:
        if not 1 <= acceleration <= ACCELERATION_MAX:
            raise CommandError(
                f"integral velocity needs an acceleration of 1..{ACCELERATION_MAX} /256 counts/sample², "
                f"not {acceleration}"
            )
        self.acceleration = acceleration
        self._position = position * 256
        self._velocity = 0
        self._target = 0

    def set_velocity(self, velocity: int) -> None:
        """Register 3CH: −128..127 counts/sample, at most 127 from the last command.

        Raises CommandError for more.
        """
        if not -128 <= velocity <= 127:
            raise CommandError(f"integral velocity {velocity} counts/sample is outside -128..127")
        if abs(velocity - self._target) > SPEED_MAX:
            raise CommandError(
                f"integral velocity {velocity} lies {abs(velocity - self._target)} counts/sample from the "
                f"last command {self._target}; at most {SPEED_MAX}"
            )
        self._target = velocity

    def step(self) -> int:
        """One sample: the new command position in counts."""
        change = self._target * 256 - self._velocity
        self._velocity += max(-self.acceleration, min(self.acceleration, change))
        self._position += self._velocity
        return self._position >> 8

    @property
    def velocity(self) -> float:
        """Internal velocity, counts/sample."""
        return self._velocity / 256

    @property
    def to_go(self) -> int:
        """Samples until the commanded velocity is reached."""
        return -(-abs(self._target * 256 - self._velocity) // self.acceleration)


def plan_trapezoid(scale: AxisScale, distance: float, speed: float, acceleration: float) -> Trapezoid:
    """The chip's profile for `distance` [rad] within `speed` [rad/s] at `acceleration` [rad/s²].

    Speed is rounded down and acceleration to the nearest the registers hold. Raises CommandError when the chip or
    the amplifier cannot do it; the amplifier is asked about the speed that this distance really reaches.
    """
    profile = Trapezoid(
        round(distance * scale.counts_per_radian),
        scale.acceleration_register(acceleration),
        scale.speed_register(speed),
    )
    peak = profile.peak_speed / (scale.period * scale.counts_per_radian)
    scale.check_drive(peak, profile.acceleration / (256 * scale.counts_per_radian * scale.period**2))
    return profile


def stretch(profile: Trapezoid, samples: int) -> Trapezoid | None:
    """The gentlest profile over the same distance that ends in exactly `samples` samples.

    No faster than `profile`. Among all speeds v the acceleration is v/(N − D/v) or 4 D/N² (a triangle), on
    the chip's grid; the pair with the least acceleration is taken, then the least speed. None when the
    registers hold none: the way is too short to take that long (the slowest is 1/256 counts/sample²), or
    `samples` is shorter than the profile itself.
    """
    distance = abs(profile.distance)
    if distance == 0 or samples < profile.samples:
        return None
    if samples == profile.samples:
        return profile
    candidates = (found for found in _of_length(profile, distance, samples) if found is not None)
    return min(candidates, key=lambda found: (found.acceleration, found.speed), default=None)


def _of_length(profile: Trapezoid, distance: int, samples: int) -> Iterator[Trapezoid | None]:
    for speed in range(1, profile.speed + 1):
        ramp = samples - distance / speed
        wanted = (4 * distance / samples**2, speed / ramp) if ramp > 0 else (4 * distance / samples**2,)
        for a in wanted:
            yield _on_grid(profile, distance, speed, a, samples)


def _on_grid(profile: Trapezoid, distance: int, speed: int, a: float, samples: int) -> Trapezoid | None:
    for register in (math.floor(a * 256), math.ceil(a * 256), math.ceil(a * 256) + 1):
        if 1 <= register <= profile.acceleration:
            found = Trapezoid(profile.distance, register, speed)
            if found.samples == samples:
                return found
    return None


def stretch_together(
    profiles: Iterable[Trapezoid], periods: Iterable[float] | None = None
) -> tuple[list[Trapezoid], list[int]]:
    """Profiles that all end at the same time, and the indices of those that cannot.

    `periods`: sample period of each in s, equal where not given. The longest one sets the time; where a register
    grid misses that very sample, a later one (up to 2 % or eight samples on) that most can meet is taken. Those
    too near to be stretched keep their slowest profile and end early.
    """
    originals = list(profiles)
    ticks = [1.0] * len(originals) if periods is None else list(periods)
    moving = [i for i, profile in enumerate(originals) if profile.distance != 0]
    if not moving:
        return originals, []
    last = max(moving, key=lambda i: originals[i].samples * ticks[i])
    longest = originals[last].samples
    best: tuple[list[int], list[Trapezoid | None], list[int]] | None = None
    for more in range(max(8, longest // 50) + 1):
        end = (longest + more) * ticks[last]
        samples = [max(round(end / tick), p.samples) for p, tick in zip(originals, ticks, strict=True)]
        tried = [stretch(p, n) for p, n in zip(originals, samples, strict=True)]
        missed = [i for i in moving if tried[i] is None]
        if best is None or len(missed) < len(best[0]):
            best = (missed, tried, samples)
        if not missed:
            break
    if best is None:
        raise AssertionError("at least one end was tried")
    early, found, samples = best
    whole = list(originals)
    for i in moving:
        chosen = found[i]
        whole[i] = slowest_within(originals[i], samples[i]) if chosen is None else chosen
    return whole, early


def slowest_within(profile: Trapezoid, samples: int) -> Trapezoid:
    """The profile over the same distance and no faster that comes nearest to `samples` from below."""
    slowest = max(Trapezoid(profile.distance, 1, v).samples for v in (1, profile.speed))
    for length in range(min(samples, slowest), profile.samples, -1):
        if (found := stretch(profile, length)) is not None:
            return found
    return profile
