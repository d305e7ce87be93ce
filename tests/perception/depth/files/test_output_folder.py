"""An output folder is filled whole or not at all."""

import errno
from pathlib import Path

import pytest

from perception.depth.errors import OptionError
from perception.depth.files.output_folder import fill_whole


def test_a_new_folder_appears_with_everything_in_it(tmp_path: Path) -> None:
    out = tmp_path / "deep" / "out"
    with fill_whole(out) as stage:
        (stage / "map").write_text("whole")
        assert not out.exists()
    assert [path.name for path in out.iterdir()] == ["map"]
    assert [path.name for path in tmp_path.iterdir()] == ["deep"]


def test_a_failure_leaves_the_old_files_as_they_were(tmp_path: Path) -> None:
    (tmp_path / "map").write_text("old")

    def fail() -> None:
        with fill_whole(tmp_path) as stage:
            (stage / "map").write_text("half")
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fail()
    assert [(path.name, path.read_text()) for path in tmp_path.iterdir()] == [("map", "old")]


def test_a_full_disk_is_one_line_and_leaves_nothing(tmp_path: Path) -> None:
    def fill() -> None:
        with fill_whole(tmp_path / "out"):
            raise OSError(errno.ENOSPC, "No space left on device")

    with pytest.raises(OptionError, match=r"out: cannot be written \(No space left"):
        fill()
    assert list(tmp_path.iterdir()) == []


def test_a_file_is_not_replaced_by_a_folder(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("mine")
    with pytest.raises(OptionError, match="is no folder"), fill_whole(tmp_path / "out"):
        pass
    assert (tmp_path / "out").read_text() == "mine"
