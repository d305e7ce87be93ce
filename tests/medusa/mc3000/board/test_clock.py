"""The board's time on the host's clock."""

import pytest

from medusa.mc3000.board.clock import BoardClock


def test_a_late_reply_does_not_move_the_clock() -> None:
    clock = BoardClock()
    # Board time 0 is loop time 5 s; the reply takes 4 ms on the wire.
    assert clock.update(1_000_000, 6.004, 0.004) == pytest.approx(6.0)
    # This one waited 90 ms in a queue: it is stamped from the earlier offset, up to 100 ppm of drift.
    assert clock.update(2_000_000, 7.094, 0.004) == pytest.approx(7.0, abs=2e-4)
    assert clock.to_loop(1_500_000) == pytest.approx(6.5, abs=2e-4)


def test_the_board_time_wraps_after_seventy_one_minutes() -> None:
    clock = BoardClock()
    clock.update(2**32 - 500_000, 100.0, 0.0)
    assert clock.update(500_000, 101.0, 0.0) == pytest.approx(101.0, abs=2e-4)
    assert clock.to_loop(2**32 - 250_000) == pytest.approx(100.25, abs=2e-4)


def test_nothing_is_known_before_the_first_reply_and_after_a_restart() -> None:
    clock = BoardClock()
    assert clock.to_loop(5) is None
    clock.update(5, 1.0, 0.0)
    clock.reset()
    assert clock.to_loop(5) is None


def test_a_host_clock_that_runs_slow_is_followed() -> None:
    clock = BoardClock()
    # The board gains 50 µs a second on the host: within the 100 ppm that the estimate may rise.
    errors = [
        clock.update(second * 1_000_000, second * 1.00005, 0.0) - second * 1.00005 for second in range(60)
    ]
    assert max(abs(error) for error in errors) < 1e-4
