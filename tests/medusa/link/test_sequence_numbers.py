"""Sequence numbers: when one may be used again."""

from medusa.link.sequence_numbers import SequenceNumbers


def test_numbers_come_in_rising_order_from_0_and_go_round() -> None:
    numbers = SequenceNumbers()
    seen = []
    for _ in range(130):
        number = numbers.take(0.0)
        assert number is not None
        seen.append(number)
        numbers.answered(number, 0.0, 0)
    assert seen == [n % 64 for n in range(130)]


def test_a_number_whose_pair_the_device_may_still_keep_is_not_given_out_whatever_time_passes() -> None:
    # Of 64 unanswered requests the device may have kept any eight: the same bytes would be taken for a repeat.
    numbers = SequenceNumbers()
    for _ in range(64):
        number = numbers.take(0.0)
        assert number is not None
        numbers.abandoned(number, 0.0, 1)
    assert numbers.take(0.5) is None
    assert numbers.take(1000.0) is None
    # A HELLO is never answered from memory, a stop cannot wait.
    assert numbers.take(1000.0, False) == 0
    assert numbers.take_anyway(1000.0) in range(1, 64)
    numbers.new_session()
    assert numbers.take(1000.0) is not None


def test_late_replies_show_that_the_device_took_requests_and_free_the_numbers_of_older_ones() -> None:
    numbers = SequenceNumbers()
    for _ in range(64):
        number = numbers.take(0.0)
        assert number is not None
        numbers.abandoned(number, 0.0, 1)
    for late in range(20, 36):
        numbers.late(late, 0.5)
    # Sixteen were taken; the quarantine of the others lasts a second.
    assert numbers.take(0.9) == 20
    assert numbers.take(1.1) == 21


def test_copies_that_may_still_be_answered_keep_a_number_out_of_use() -> None:
    numbers = SequenceNumbers()
    first = numbers.take(0.0)
    assert first == 0
    numbers.answered(first, 0.0, 2)
    for _ in range(63):
        number = numbers.take(0.1)
        assert number is not None
        numbers.answered(number, 0.1, 0)
    assert numbers.take(0.2) == 1
    numbers.late(0, 0.3)
    numbers.late(0, 0.3)
    numbers.answered(1, 0.3, 0)
    for _ in range(62):
        number = numbers.take(0.3)
        assert number is not None
        numbers.answered(number, 0.3, 0)
    assert numbers.take(0.3) == 0


def test_the_end_of_the_next_quarantine_is_told() -> None:
    numbers = SequenceNumbers()
    assert numbers.next_release(0.0) is None
    number = numbers.take(0.0)
    assert number is not None
    numbers.abandoned(number, 0.25, 1)
    assert numbers.next_release(0.5) == 1.25
    assert numbers.next_release(1.5) is None
