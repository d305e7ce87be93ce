"""An output folder that is filled whole or not at all: what fails half-way leaves nothing behind."""

import os
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from perception.depth.errors import OptionError


@contextmanager
def fill_whole(out: Path) -> Iterator[Path]:
    """Give a folder to write into; its files move to `out` when the block ends without an exception.

    The folder lies on the file system of `out`, so moving is renaming. Files that `out` already holds stay,
    unless one of the same name is written.

    Raises:
        OptionError: `out` is no folder, or it cannot be written.
    """
    if out.exists() and not out.is_dir():
        raise OptionError(f"{out}: is no folder; it is not replaced")
    there = next(folder for folder in (out, *out.absolute().parents) if folder.is_dir())
    stage = there / f".{out.name}.{os.getpid()}.part"
    try:
        stage.mkdir()
        try:
            yield stage
            out.mkdir(parents=True, exist_ok=True)
            for file in sorted(stage.iterdir()):
                file.replace(out / file.name)
        finally:
            shutil.rmtree(stage, ignore_errors=True)
    except OSError as error:
        raise OptionError(f"{out}: cannot be written ({error.strerror or error})") from error
