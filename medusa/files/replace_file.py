"""Writing a file whole or not at all: configurations and records that a crash must not leave half-written."""

import errno
import os
import secrets
import stat
from pathlib import Path

from medusa.errors import ConfigError

_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_NOFOLLOW | os.O_CLOEXEC
"""A file that was not there before, under no link."""


def replace_file(path: Path, text: str) -> None:
    """Write a file, its folder included, beside the old one and put it in its place, both synced to the disk.

    Whatever goes wrong, the old file is whole. A link at `path` is followed, permissions are kept. Raises ConfigError
    when it cannot be written, and for what is no regular file: a folder or a device is never replaced.
    """
    try:
        target = path.resolve()
        mode = target.stat().st_mode if target.exists() else None
        if mode is not None and not stat.S_ISREG(mode):
            raise ConfigError(str(path), "", None, "is no regular file; it is not replaced")
        if not target.parent.exists():
            target.parent.mkdir(parents=True, exist_ok=True)
        new = target.with_name(f".{secrets.token_hex(8)}.new")
        descriptor = os.open(new, _NEW, 0o666 if mode is None else stat.S_IMODE(mode))
        try:
            with open(descriptor, "w", encoding="utf-8") as file:
                if mode is not None:
                    os.fchmod(descriptor, stat.S_IMODE(mode))
                file.write(text)
                file.flush()
                os.fsync(descriptor)
            new.replace(target)
        except BaseException:
            new.unlink(missing_ok=True)
            raise
        _sync_folder(target.parent)
    except (OSError, RuntimeError) as error:
        # RuntimeError: links that lead in a circle.
        reason = error.strerror if isinstance(error, OSError) else "its links lead in a circle"
        raise ConfigError(str(path), "", None, f"cannot be written: {reason}") from None


def _sync_folder(path: Path) -> None:
    """Make the new name survive a crash, where the file system can sync a folder."""
    folder = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_CLOEXEC)
    try:
        os.fsync(folder)
    except OSError as error:
        if error.errno != errno.EINVAL:
            raise
    finally:
        os.close(folder)
