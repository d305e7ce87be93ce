"""A pseudo-terminal that behaves like a serial port: raw from the start and alive without a client."""

import contextlib
import errno
import logging
import os
import termios
import tty
from pathlib import Path

log = logging.getLogger(__name__)

_READ_SIZE = 4096


class PtyPort:
    """An open pseudo-terminal. The device's side is `fd`, non-blocking; clients open `tty_path`.

    The port holds the clients' side open as well: the terminal keeps its settings from one client to the
    next, and without a client the descriptor reports no hang-up that would keep an event loop busy.
    """

    def __init__(self) -> None:
        self.fd, self._client_side = os.openpty()
        tty.setraw(self._client_side, termios.TCSANOW)
        os.set_blocking(self.fd, False)
        self.tty_path = os.ttyname(self._client_side)

    def close(self) -> None:
        """Hang up: a client sees an end of file or EIO."""
        os.close(self.fd)
        os.close(self._client_side)

    def read(self) -> bytes:
        """Return what clients have written, at most 4096 bytes; b"" when nothing is there."""
        try:
            return os.read(self.fd, _READ_SIZE)
        except BlockingIOError:
            return b""

    def write(self, data: bytes) -> int:
        """Write what fits; return how many bytes were lost, as they are on a line without flow control."""
        try:
            return len(data) - os.write(self.fd, data)
        except BlockingIOError:
            return len(data)
        except OSError as error:
            if error.errno != errno.EIO:
                raise
            return len(data)


def place_link(link: Path, target: str) -> None:
    """Point a symbolic link at the terminal, replacing an older one; OSError when it cannot be put there."""
    if link.exists() and not link.is_symlink():
        raise FileExistsError(errno.EEXIST, "is in the way of the link and is not a link itself", str(link))
    beside = link.with_name(f".{link.name}.{os.getpid()}")
    with contextlib.suppress(FileNotFoundError):
        beside.unlink()
    beside.symlink_to(target)
    beside.replace(link)


def remove_link(link: Path, target: str) -> None:
    """Remove the link if it is still ours."""
    with contextlib.suppress(OSError):
        if os.readlink(link) == target:
            link.unlink()
