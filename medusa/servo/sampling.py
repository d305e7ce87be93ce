"""The chip's sample timer: the sample periods it can make, the timer that a period needs."""

import math

from medusa.errors import CommandError

CLOCK_HZ = 2_000_000
TICK = 16 / CLOCK_HZ
"""Step of the sample period, 8 µs."""
TIMER_MIN = 7
"""Least timer in position and proportional velocity mode (64 µs)."""
TIMER_MIN_PROFILE = 15
"""Least timer in integral velocity mode and in profiles (128 µs)."""
TIMER_MAX = 255
"""Greatest timer (2.048 ms), the thesis's choice."""


def sample_period(timer: int) -> float:
    """Sample period in seconds, t = 16 (T + 1)/f_clk; raises CommandError outside 7..255."""
    if not TIMER_MIN <= timer <= TIMER_MAX:
        raise CommandError(
            f"sample timer {timer} is outside {TIMER_MIN}..{TIMER_MAX} "
            f"({(TIMER_MIN + 1) * TICK * 1e6:.0f}..{(TIMER_MAX + 1) * TICK * 1e6:.0f} µs)"
        )
    return (timer + 1) * TICK


def longest_timer_within(period: float) -> int | None:
    """The greatest timer whose sample period is at most `period` seconds; None when even T = 7 is longer."""
    timer = min(math.floor(period / TICK + 1e-9) - 1, TIMER_MAX)
    return timer if timer >= TIMER_MIN else None


def timer_for(period: float) -> int:
    """The timer that makes exactly `period` seconds; raises CommandError naming the two periods next to it."""
    nearest = round(period / TICK) - 1
    if TIMER_MIN <= nearest <= TIMER_MAX and math.isclose((nearest + 1) * TICK, period, rel_tol=1e-9):
        return nearest
    low = min(max(math.floor(period / TICK) - 1, TIMER_MIN), TIMER_MAX)
    high = min(low + 1, TIMER_MAX)
    raise CommandError(
        f"the chip makes no sample period of {period * 1e6:.6g} µs; the next ones are "
        f"{sample_period(low) * 1e6:.0f} µs (T = {low}) and {sample_period(high) * 1e6:.0f} µs (T = {high})"
    )
