"""What keys of the configuration demand of each other, and what the chip can do with them."""

import re
from collections import Counter
from collections.abc import Iterator

from medusa.errors import CommandError, ConfigError
from medusa.mc3000.board import make_profile
from medusa.mc3000.config import CHIP_CLOCK_HZ, AxisConfig, Mc3000Config

JOINT_NAME = re.compile("[a-z][a-z0-9_]*")
PROFILE_TIMER_MIN = 15
MAX_FOLLOWING_COUNTS = 65535

Wrong = tuple[str, object, str]


def check_limits(config: Mc3000Config, file: str) -> None:
    """Raise ConfigError for the first key that does not go with the others."""
    for key, value, allowed in _wrong(config):
        raise ConfigError(file, key, value, allowed)


def _wrong(config: Mc3000Config) -> Iterator[Wrong]:
    if not config.axes:
        yield "axes", {}, "at least one table [axes.NAME]"
    for name, axis in config.axes.items():
        if not JOINT_NAME.fullmatch(name):
            yield f"axes.{name}", name, "a joint's name is of lower-case letters, digits and underscores"
        for key, value, allowed in _wrong_axis(axis):
            yield f"axes.{name}.{key}", value, allowed
    yield from _wrong_wiring(config)
    named = [name for group in config.homing.order for name in group]
    if Counter(named) != Counter(list(config.axes)):
        yield "homing.order", named, f"every one of {', '.join(config.axes)} exactly once"
    least = config.safety.board_watchdog_ms + 1000 * config.ramp_seconds
    amplifier = config.safety.amplifier_watchdog_ms
    if 0 < amplifier <= least:
        yield (
            "safety.amplifier_watchdog_ms",
            amplifier,
            f"0 or more than {least:.0f} ms, the board's watchdog and the longest ramp together",
        )


def _wrong_axis(axis: AxisConfig) -> Iterator[Wrong]:
    if axis.soft_min_deg >= axis.soft_max_deg:
        yield "soft_min_deg", axis.soft_min_deg, f"less than soft_max_deg, {axis.soft_max_deg:g}"
    for key in ("home_deg", "park_deg", "home_edge_deg"):
        angle = getattr(axis, key)
        if not axis.soft_min_deg <= angle <= axis.soft_max_deg:
            yield key, angle, f"between the soft limits, {axis.soft_min_deg:g} to {axis.soft_max_deg:g}"
    if not 1 <= axis.following_limit_counts <= MAX_FOLLOWING_COUNTS:
        allowed = f"1 to {MAX_FOLLOWING_COUNTS} counts, {1 / axis.counts_per_degree:.4f}"
        yield (
            "following_limit_deg",
            axis.following_limit_deg,
            f"{allowed} to {MAX_FOLLOWING_COUNTS / axis.counts_per_degree:.1f}",
        )
    for mode in ("position", "integral_velocity"):
        timer = getattr(axis.filters, mode).T
        if timer < PROFILE_TIMER_MIN:
            yield f"filters.{mode}.T", timer, f"at least {PROFILE_TIMER_MIN}: profiles run in this mode"
    for key in ("max_speed_deg_s", "search_speed_deg_s", "approach_speed_deg_s"):
        speed = getattr(axis, key)
        if key != "max_speed_deg_s" and speed > axis.max_speed_deg_s:
            yield key, speed, f"at most max_speed_deg_s, {axis.max_speed_deg_s:g}"
        for mode in ("position", "integral_velocity"):
            try:
                make_profile(
                    axis.acceleration_deg_s2 * axis.counts_per_degree,
                    speed * axis.counts_per_degree,
                    getattr(axis.filters, mode).filter,
                    CHIP_CLOCK_HZ,
                )
            except CommandError as error:
                wrong = "acceleration_deg_s2" if "acceleration" in str(error) else key
                yield wrong, getattr(axis, wrong), str(error)


def _wrong_wiring(config: Mc3000Config) -> Iterator[Wrong]:
    channels: dict[tuple[int, int], str] = {}
    amplifiers: dict[int, str] = {}
    timers: dict[int, tuple[str, int]] = {}
    for name, axis in config.axes.items():
        taken = channels.setdefault((axis.board, axis.channel), name)
        if taken != name:
            yield f"axes.{name}.channel", axis.channel, f"not that of {taken} on board {axis.board}"
        taken = amplifiers.setdefault(axis.amplifier, name)
        if taken != name:
            yield f"axes.{name}.amplifier", axis.amplifier, f"not that of {taken}"
        other, timer = timers.setdefault(axis.board, (name, axis.filters.position.T))
        if timer != axis.filters.position.T:
            yield (
                f"axes.{name}.filters.position.T",
                axis.filters.position.T,
                f"{timer}, that of {other}: joints of one board start together only with equal timers",
            )
