"""The docs point at what there is: decisions in their index, links to files, modules that exist."""

import re
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
PAGES = sorted([*ROOT.glob("*.md"), *(ROOT / "docs").rglob("*.md")])
LINK = re.compile(r"\]\((?!https?:|#)([^)#\s]+)(?:#[^)]*)?\)")
MODULE = re.compile(r"`((?:medusa|labmate|perception|sim_devices|tools|tests)/[\w/.-]+\.(?:py|toml|json))`")


def test_every_decision_is_in_the_index_once_under_its_title() -> None:
    index = (ROOT / "docs/decisions/README.md").read_text(encoding="utf-8")
    numbers = re.findall(r"^\| (\d{4}) \|", index, flags=re.MULTILINE)
    assert numbers == sorted(set(numbers))
    for path in sorted((ROOT / "docs/decisions").glob("0*.md")):
        number, title = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ").split(" ", 1)
        assert path.name.startswith(number)
        assert f"| {number} | [{title}]({path.name}) |" in index


@pytest.mark.parametrize("page", PAGES, ids=lambda page: str(page.relative_to(ROOT)))
def test_links_and_files_that_a_page_names_are_there(page: Path) -> None:
    text = page.read_text(encoding="utf-8")
    missing = [link for link in LINK.findall(text) if not (page.parent / link).exists()]
    missing += [name for name in MODULE.findall(text) if not (ROOT / name).exists()]
    assert missing == []
