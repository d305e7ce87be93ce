"""A file is replaced whole or not at all, whatever goes wrong, and nothing else is touched."""

import os
import resource
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest

from medusa.errors import ConfigError
from medusa.files.replace_file import replace_file


@pytest.fixture
def kept(tmp_path: Path) -> Path:
    path = tmp_path / "square.json"
    path.write_text("driven with care")
    return path


@contextmanager
def full_disk() -> Iterator[None]:
    """A limit on the size of files stands in for a full disk; it fails like one, in the middle of writing."""
    soft, hard = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (100, hard))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, (soft, hard))


def test_a_full_disk_leaves_the_old_file_whole_and_nothing_beside_it(kept: Path) -> None:
    with full_disk(), pytest.raises(ConfigError, match=rf"^{kept}: cannot be written: File too large$"):
        replace_file(kept, "another" * 1000)
    assert kept.read_text() == "driven with care"
    assert list(kept.parent.iterdir()) == [kept]


def test_permissions_are_kept_and_a_new_file_gets_those_of_the_umask(kept: Path) -> None:
    before = os.umask(0o027)
    try:
        # More than the umask would leave, and less.
        for mode in (0o666, 0o600):
            kept.chmod(mode)
            replace_file(kept, "another")
            assert kept.stat().st_mode & 0o7777 == mode
        new = kept.with_name("new.json")
        replace_file(new, "first")
        assert new.stat().st_mode & 0o7777 == 0o640
    finally:
        os.umask(before)


def test_the_folder_of_a_new_file_is_made(tmp_path: Path) -> None:
    replace_file(tmp_path / "a" / "b" / "c.toml", "x = 1")
    assert (tmp_path / "a" / "b" / "c.toml").read_text() == "x = 1"


def test_a_link_stays_one_and_what_it_names_is_replaced(kept: Path) -> None:
    (kept.parent / "elsewhere").mkdir()
    link = kept.parent / "elsewhere" / "link.json"
    link.symlink_to(kept)
    replace_file(link, "another")
    assert link.is_symlink()
    assert kept.read_text() == "another"
    assert list(link.parent.iterdir()) == [link]


def test_a_link_that_lies_where_a_temporary_name_could_be_guessed_is_not_followed(kept: Path) -> None:
    victim = kept.with_name("victim")
    victim.write_text("untouched")
    kept.with_name("square.json.new").symlink_to(victim)
    replace_file(kept, "another")
    assert (kept.read_text(), victim.read_text()) == ("another", "untouched")


@pytest.mark.parametrize("path", ["/dev/full", "/dev/null", "."])
def test_a_device_or_a_folder_is_never_replaced(path: str, tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="is no regular file; it is not replaced"):
        replace_file(tmp_path / path, "text")


def test_links_in_a_circle_are_one_line(tmp_path: Path) -> None:
    (tmp_path / "a").symlink_to("b")
    (tmp_path / "b").symlink_to("a")
    with pytest.raises(ConfigError, match="cannot be written"):
        replace_file(tmp_path / "a", "text")


def test_contents_and_name_are_synced_in_that_order(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    # What a crash leaves cannot be tried here; the order of the calls is what the kernel promises it by.
    calls: list[str] = []
    fsync, rename = os.fsync, os.replace

    def noted(descriptor: int) -> None:
        calls.append("folder" if os.path.isdir(f"/proc/self/fd/{descriptor}") else "file")
        fsync(descriptor)

    monkeypatch.setattr(os, "fsync", noted)
    monkeypatch.setattr(os, "replace", lambda *names: (calls.append("rename"), rename(*names)))
    replace_file(kept, "another")
    assert calls == ["file", "rename", "folder"]
