"""Writing a file whole or not at all: a record of driven squares must survive a full disk."""

from __future__ import annotations

from pathlib import Path

from medusa.errors import ConfigError


def replace_file(path: Path, text: str) -> None:
    """Write a file, its directory included, beside the old one and put it in its place.

    Whatever goes wrong, the old file is still whole. Raises ConfigError.
    """
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        target = path.resolve()
        if target.exists() and not target.is_file():
            # A device or a pipe is written, never replaced.
            target.write_text(text, encoding="utf-8")
            return
        new = target.with_name(target.name + ".new")
        try:
            new.write_text(text, encoding="utf-8")
            new.replace(target)
        except OSError:
            if new.is_file():
                new.unlink()
            raise
    except OSError as error:
        raise ConfigError(str(path), "", None, f"cannot be written: {error.strerror}") from error
