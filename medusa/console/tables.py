"""Tables for people."""

import re
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from rich.table import Table

_NUMBER = re.compile(r"[-+]?\d+(\.\d*)?(e[-+]\d+)?|–")


def make_table(title: str, rows: Sequence[Mapping[str, Any]]) -> "Table":
    """A table with a column a key, numbers to the right."""
    from rich.box import SIMPLE_HEAD
    from rich.table import Table

    table = Table(title=title, title_justify="left", title_style="bold", box=SIMPLE_HEAD, pad_edge=False)
    for key in rows[0] if rows else ():
        words = key.split("_")
        table.add_column(
            " ".join(words),
            justify="right" if all(_is_number(row[key]) for row in rows) else "left",
            no_wrap=key == "axis",
            min_width=max(map(len, words)),
        )
    for row in rows:
        table.add_row(*(_cell(value) for value in row.values()))
    return table


def print_table(title: str, rows: Sequence[Mapping[str, Any]]) -> None:
    """Print a table on stdout."""
    from rich.console import Console

    Console().print(make_table(title, rows))


def _is_number(value: Any) -> bool:
    """Whether a cell shows a number, or that there is none; a text is one when it was formatted so."""
    if isinstance(value, str):
        return _NUMBER.fullmatch(value) is not None
    return isinstance(value, int | float | None) and not isinstance(value, bool)


def _cell(value: Any) -> str:
    if value is None:
        return "–"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if isinstance(value, float):
        return f"{value:.3f}"
    if isinstance(value, list):
        return ", ".join(map(str, value)) or "none"
    if isinstance(value, dict):
        return ", ".join(f"{key} {item}" for key, item in value.items())
    return str(value)
