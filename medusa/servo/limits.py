"""What the chip and the amplifier can do: speeds, accelerations and the sample periods they need.

The chip holds speeds as at most 127 whole counts a sample and accelerations as 1/256 counts/sample²
(docs/protocols). What cannot be done is refused with the number in the way and the sample period that would
do.
"""

import math
from dataclasses import dataclass

from medusa.errors import CommandError
from medusa.servo.plant import DAC_MAX, Plant
from medusa.servo.sampling import TIMER_MIN_PROFILE, longest_timer_within, sample_period

SPEED_MAX = 127
"""Greatest speed the chip holds, counts per sample (28H, 3CH)."""
ACCELERATION_MAX = 0x7FFF
"""Greatest acceleration the chip holds, 1/256 counts/sample² (26H, 27H)."""


@dataclass(frozen=True)
class AxisScale:
    """Counts and samples of one axis: E in counts/rad, its sample timer, and its plant where it is known."""

    counts_per_radian: float
    timer: int
    plant: Plant | None = None
    name: str = "axis"

    @property
    def period(self) -> float:
        """Sample period, s."""
        return sample_period(self.timer)

    def counts_per_sample(self, speed: float) -> float:
        """rad/s to counts per sample."""
        return speed * self.counts_per_radian * self.period

    def _degrees(self, counts_per_second: float) -> float:
        return math.degrees(counts_per_second / self.counts_per_radian)

    @property
    def chip_speed(self) -> float:
        """Greatest speed of a profile at this sample period, rad/s: 127 counts a sample."""
        return SPEED_MAX / (self.period * self.counts_per_radian)

    @property
    def least_speed(self) -> float:
        """Least speed of the integral velocity mode, rad/s: one count a sample (table 6.1)."""
        return 1 / (self.period * self.counts_per_radian)

    @property
    def amplifier_speed(self) -> float:
        """Speed at DAC 127 in rad/s, C 127/E; infinite when the plant is not known."""
        return self.plant.top_speed / self.counts_per_radian if self.plant is not None else math.inf

    def timer_for_speed(self, speed: float) -> int | None:
        """The longest sample timer at which the chip holds a speed in rad/s; None when no timer does."""
        if speed == 0:
            return self.timer
        timer = longest_timer_within(SPEED_MAX / (abs(speed) * self.counts_per_radian))
        return timer if timer is not None and timer >= TIMER_MIN_PROFILE else None

    def check_speed(self, speed: float) -> None:
        """Raise CommandError when the chip or the amplifier cannot do `speed` [rad/s]."""
        if not math.isfinite(speed):
            raise CommandError(f"{self.name}: a speed of {speed} rad/s is no number that can be commanded")
        counts = abs(self.counts_per_sample(speed))
        asked = f"{self.name}: {math.degrees(abs(speed)):.1f}°/s"
        if abs(speed) > self.amplifier_speed:
            raise CommandError(
                f"{asked} is over the {math.degrees(self.amplifier_speed):.1f}°/s that the amplifier "
                f"reaches at DAC {DAC_MAX}; no sample period allows it"
            )
        if counts > SPEED_MAX * (1 + 1e-9):
            timer = self.timer_for_speed(speed)
            way = (
                f"a sample period of {sample_period(timer) * 1e3:.3f} ms (T = {timer}) or less would allow it"
                if timer is not None
                else f"no sample period allows it (the shortest is {sample_period(TIMER_MIN_PROFILE) * 1e3:.3f} ms)"
            )
            raise CommandError(
                f"{asked} is {counts:.1f} counts a sample at {self.period * 1e3:.3f} ms, the chip holds "
                f"{SPEED_MAX} ({math.degrees(self.chip_speed):.1f}°/s); {way}"
            )

    def speed_register(self, speed: float) -> int:
        """Byte for 28H, whole counts a sample, rounded down so that the speed is never exceeded.

        Raises CommandError for a speed over the limits, zero, negative, or below one count a sample.
        """
        if not speed > 0:
            raise CommandError(
                f"{self.name}: a profile needs a speed above 0, not {math.degrees(speed):g}°/s"
            )
        self.check_speed(speed)
        register = math.floor(self.counts_per_sample(speed) * (1 + 1e-9))
        if register == 0:
            raise CommandError(
                f"{self.name}: {math.degrees(speed):.3g}°/s is below one count a sample "
                f"({math.degrees(self.least_speed):.3g}°/s at {self.period * 1e3:.3f} ms)"
            )
        return register

    def acceleration_register(self, acceleration: float) -> int:
        """Word for 26H/27H, 1/256 counts/sample², the nearest to `acceleration` [rad/s²].

        Raises CommandError for zero, negative, below 1/512 or above 127.998 counts/sample².
        """
        if not (math.isfinite(acceleration) and acceleration > 0):
            raise CommandError(
                f"{self.name}: an acceleration of {math.degrees(acceleration):g}°/s² moves nothing; "
                f"it must be above 0"
            )
        unit = 1 / (256 * self.counts_per_radian * self.period**2)
        register = round(acceleration / unit)
        if 1 <= register <= ACCELERATION_MAX:
            return register
        if register == 0:
            allowed = f"at least {math.degrees(unit):.3g}°/s²"
            period = math.sqrt(1 / (256 * self.counts_per_radian * acceleration))
            hint = (
                f"a longer sample period, {period * 1e3:.3f} ms" if period < 2.048e-3 else "no sample period"
            )
        else:
            allowed = f"at most {math.degrees(ACCELERATION_MAX * unit):.5g}°/s²"
            timer = longest_timer_within(
                math.sqrt(ACCELERATION_MAX / (256 * self.counts_per_radian * acceleration))
            )
            hint = (
                "no sample period"
                if timer is None or timer < TIMER_MIN_PROFILE
                else f"a sample period of {sample_period(timer) * 1e3:.3f} ms (T = {timer})"
            )
        raise CommandError(
            f"{self.name}: an acceleration of {math.degrees(acceleration):.5g}°/s² cannot be held at "
            f"{self.period * 1e3:.3f} ms, {allowed}; {hint} would allow it"
        )

    def check_drive(self, speed: float, acceleration: float) -> None:
        """Raise CommandError when speed and acceleration together need more than DAC 127: (v + a T_M)/C."""
        if self.plant is None:
            return
        demand = abs(speed) + abs(acceleration) * self.plant.time_constant
        dac = demand * self.counts_per_radian / self.plant.velocity_gain
        if dac > DAC_MAX:
            raise CommandError(
                f"{self.name}: {math.degrees(abs(speed)):.1f}°/s at {math.degrees(abs(acceleration)):.0f}°/s² "
                f"needs {dac:.1f} DAC counts, the amplifier gets at most {DAC_MAX}; no sample period allows it"
            )
