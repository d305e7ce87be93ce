"""Writing a file whole or not at all: configurations and records that a crash must not leave half-written."""

import os
import shutil
from pathlib import Path

from medusa.errors import ConfigError


def replace_file(path: Path, text: str) -> None:
    """Write a file beside the old one and put it in its place; a full disk leaves the old one whole.

    A link is followed, permissions are kept. Raises ConfigError when it cannot be written, and for what is no
    regular file: a folder or a device is never replaced.
    """
    try:
        target = path.resolve()
        there = target.exists()
        if there and not target.is_file():
            raise ConfigError(str(path), "", None, "is no regular file; it is not replaced")
        new = target.with_name(target.name + ".new")
        try:
            with new.open("w", encoding="utf-8") as file:
                file.write(text)
                file.flush()
                os.fsync(file.fileno())
            if there:
                shutil.copymode(target, new)
            new.replace(target)
        except OSError:
            new.unlink(missing_ok=True)
            raise
    except (OSError, RuntimeError) as error:
        # RuntimeError: links that lead in a circle.
        reason = error.strerror if isinstance(error, OSError) else "its links lead in a circle"
        raise ConfigError(str(path), "", None, f"could not be written: {reason}") from None
