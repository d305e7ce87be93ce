"""Tables for people: what a cell shows for each kind of value, and numbers aligned to the right."""

import pytest

from medusa.console import print_table


def test_cells_show_what_is_known_and_numbers_are_right_aligned(capsys: pytest.CaptureFixture[str]) -> None:
    rows = [
        {"axis": "pan", "angle_deg": 1.5, "homed": True, "way": "0.25"},
        {"axis": "tilt", "angle_deg": None, "homed": False, "way": "-10.0"},
    ]
    print_table("joints", rows)
    assert [line.rstrip() for line in capsys.readouterr().out.splitlines()] == [
        "joints",
        "",
        " axis   angle deg   homed     way",
        " ────────────────────────────────",
        " pan        1.500   yes      0.25",
        " tilt           –   no      -10.0",
        "",
    ]


def test_lists_and_groups_are_shown_in_one_cell(capsys: pytest.CaptureFixture[str]) -> None:
    print_table(
        "base", [{"bumpers": [], "pose": {"x": 1.0, "y": 2.0}}, {"bumpers": ["front", "left"], "pose": {}}]
    )
    out = capsys.readouterr().out
    assert " none          x 1.0, y 2.0" in out
    assert " front, left" in out
