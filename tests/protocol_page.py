"""The tables of docs/protocols.md, for tests that hold the drivers' own tables to them."""

import re
from pathlib import Path

from medusa.link.layout import Layout

PAGE = (Path(__file__).parents[1] / "docs/protocols.md").read_text(encoding="utf-8")
AXES = {"a": "one", "0F": "whole", "a, 0F": "either"}
CODES = {"u8": "B", "i8": "b", "u16": "H", "i16": "h", "u32": "I", "i32": "i"}


def codes(fields: str) -> str:
    """Struct codes of a list of fields as the page writes them: "a u16, b, c i32"; a type holds for those before it.

    What stands behind "for each axis:" comes three times.
    """
    fields, _, each = fields.partition("for each axis:")
    if each:
        return codes(fields) + 3 * codes(each)
    found: list[str] = []
    untyped = 0
    for item in re.sub(r"\([^)]*\)", "", fields).split(","):
        typed = re.search(r"\b([ui](?:8|16|32))\b", item)
        untyped += item.strip() not in ("", "–", "u16 each")
        if typed:
            found += [CODES[typed[1]]] * untyped
            untyped = 0
    return "".join(found)


def axes(section: int) -> dict[int, str]:
    """What each operation of a table with a column "axis" is for, by number."""
    text = re.split(r"^## ", PAGE, flags=re.MULTILINE)[section]
    rows = re.findall(r"^\| ([0-9A-F]{2}) [A-Z_]+ \| ([^|]*) \|", text, flags=re.MULTILINE)
    return {int(code, 16): AXES[axis] for code, axis in rows}


def operations(section: int) -> dict[int, tuple[str, str, str]]:
    """Name, request and reply of each operation in one section's table, as struct codes, by number."""
    rows: dict[int, tuple[str, str, str]] = {}
    text = re.split(r"^## ", PAGE, flags=re.MULTILINE)[section]
    for head, cells in re.findall(r"^\| ([0-9A-F]{2} [A-Z_]+[^|]*)\|(.*)\|$", text, flags=re.MULTILINE):
        if "→" not in cells:
            continue
        request, reply = re.split(r"\s*→\s*", cells.split("|")[-1], maxsplit=1)
        for code, name in re.findall(r"([0-9A-F]{2}) ([A-Z_]+)", head):
            rows[int(code, 16)] = name, codes(request), codes(reply.split(". ")[0])
    return rows


def written(layout: Layout | None) -> str:
    """Struct codes of a layout."""
    return "" if layout is None else "".join(field.code for field in layout.fields)
