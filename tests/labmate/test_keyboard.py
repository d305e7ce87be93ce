"""Keys of a terminal: what a held key commands, and how soon a released one is noticed."""

import pytest

from labmate.keyboard import FIRST_HOLD, REPEAT_HOLD, Keys, split_keys


@pytest.mark.parametrize(
    ("data", "keys"),
    [
        (b"wasd", ["w", "a", "s", "d"]),
        (b"\x1b[A\x1b[B\x1b[C\x1b[D", ["w", "s", "d", "a"]),
        (b"\x1bOAw", ["w", "w"]),
        (b"\x1b[A" * 3, ["w"] * 3),
        (b"\x1b", [" "]),
        (b"\x1b[", [" "]),
        (b"w\x1b[5~w", ["w", " "]),
        (b"\x00\xff\x7f", [" ", " ", " "]),
        (b"", []),
    ],
)
def test_what_is_not_understood_is_a_stop(data: bytes, keys: list[str]) -> None:
    assert split_keys(data) == keys


def test_a_key_drives_and_its_absence_stops() -> None:
    keys = Keys()
    assert keys.command(0.0) is None
    keys.press("w", 0.0)
    assert keys.command(0.1) == (keys.scale, 0.0)
    # The first repeat of a terminal may take 0.66 s.
    assert keys.command(0.66) is not None
    assert keys.command(FIRST_HOLD) is None


def test_a_repeating_key_is_believed_for_a_shorter_time() -> None:
    keys = Keys()
    for at in (0.0, 0.5, 0.53, 0.56):
        keys.press("a", at)
    assert keys.command(0.56 + REPEAT_HOLD - 0.01) == (0.0, keys.scale)
    assert keys.command(0.56 + REPEAT_HOLD) is None


def test_a_key_that_was_let_go_begins_anew() -> None:
    keys = Keys()
    keys.press("w", 0.0)
    assert keys.command(1.0) is None
    keys.press("w", 1.0)
    assert keys.command(1.6) is not None


def test_another_key_replaces_the_first_and_any_other_stops() -> None:
    keys = Keys()
    keys.press("w", 0.0)
    keys.press("d", 0.1)
    assert keys.command(0.2) == (0.0, -keys.scale)
    keys.press("x", 0.2)
    assert keys.command(0.2) is None


@pytest.mark.parametrize(("key", "shares"), [("s", (-1, 0)), ("u", (1, 1)), ("o", (1, -1)), ("d", (0, -1))])
def test_each_key_has_its_direction(key: str, shares: tuple[float, float]) -> None:
    keys = Keys()
    keys.press(key, 0.0)
    assert keys.command(0.0) == (shares[0] * keys.scale, shares[1] * keys.scale)


def test_the_speed_changes_in_steps_between_a_tenth_and_the_limit() -> None:
    keys = Keys()
    for _ in range(20):
        keys.press("+", 0.0)
    assert keys.scale == 1.0
    for _ in range(20):
        keys.press("-", 0.0)
    assert keys.scale == 0.1
    # Neither is a drive key: nothing moves.
    assert keys.command(0.0) is None
