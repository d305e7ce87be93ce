"""The base's clock of 32-bit microseconds, which wraps after 71 minutes."""

import pytest

from labmate.driver.clock import DeviceClock

WRAP_S = 2**32 * 1e-6


def test_stamps_go_on_over_the_wrap() -> None:
    clock = DeviceClock()
    before = clock.seconds(2**32 - 500_000)
    after = clock.seconds(250_000)
    assert after - before == pytest.approx(0.75)
    assert clock.seconds(1_250_000) - before == pytest.approx(1.75)


def test_a_late_stamp_stays_before_a_later_one_also_over_the_wrap() -> None:
    clock = DeviceClock()
    latest = clock.seconds(100)
    assert clock.seconds(2**32 - 100) == pytest.approx(latest - 200e-6)
    assert clock.seconds(100) == latest


def test_many_wraps_add_up() -> None:
    clock = DeviceClock()
    start = clock.seconds(0)
    for quarter in range(1, 41):
        stamp = clock.seconds(quarter * 2**30 % 2**32)
    assert stamp - start == pytest.approx(10 * WRAP_S)
