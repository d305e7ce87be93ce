"""A serial port: pyserial opens and configures it, the event loop moves its bytes.

The descriptor never blocks. What the driver does not take is kept as whole frames and written when it can take
more; a hang-up (EIO, POLLHUP or end of file) closes the port and is reported once. No threads.
"""

import asyncio
import errno
import grp
import logging
import os
import stat
import termios
from collections import deque
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final

import serial

from medusa.errors import PortError

log = logging.getLogger(__name__)

# A read of this size is decoded in well under a millisecond: a flood of garbage cannot hold the event loop.
_READ_BYTES: Final = 4096
_FIRST_RETRY_S: Final = 0.1
_LAST_RETRY_S: Final = 2.0


class Port:
    """An open descriptor with a queue of frames before it."""

    def __init__(
        self,
        path: str,
        baud: int,
        received: Callable[[bytes], None],
        lost: Callable[[str], None],
        leaving: Callable[[], None] = lambda: None,
    ) -> None:
        """Describe the port; `leaving` is called before frames leave that have waited, and may dequeue them."""
        self.path = path
        self.baud = baud
        self._received = received
        self._lost = lost
        self._leaving = leaving
        self._serial: serial.Serial | None = None
        self._loop: asyncio.AbstractEventLoop | None = None
        self._fd = -1
        self._begun = b""
        self._backlog: deque[bytes] = deque()

    @property
    def is_open(self) -> bool:
        return self._fd >= 0

    @property
    def backlog_bytes(self) -> int:
        """Bytes that the driver has not taken yet."""
        return len(self._begun) + sum(map(len, self._backlog))

    def open(self) -> None:
        """Open the port for ourselves alone, raw, at the given baud rate.

        Raises PortError: no such port, busy, permission, not a serial port, baud rate.
        """
        self._serial = open_serial(self.path, self.baud)
        self._fd = self._serial.fileno()
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(self._fd, self._readable)

    def write(self, frame: bytes) -> None:
        """Write a frame now, or as soon as the driver takes it; on a closed port it is dropped."""
        if self._begun or self._backlog:
            self._backlog.append(frame)
        elif self._fd >= 0:
            self._write_first(frame)

    def write_ahead(self, frame: bytes) -> None:
        """Write a frame before everything that still waits here (after the rest of one that has begun)."""
        if self._begun or self._backlog:
            self._backlog.appendleft(frame)
        elif self._fd >= 0:
            self._write_first(frame)

    def dequeue(self, frame: bytes) -> bool:
        """Take back a frame that waits here; False when some of it has been written."""
        if self._backlog:
            with suppress(ValueError):
                self._backlog.remove(frame)
                return True
        return False

    def close(self) -> None:
        """Close the port; what still waits here is dropped."""
        if self._serial is None or self._loop is None:
            return
        self._loop.remove_reader(self._fd)
        self._loop.remove_writer(self._fd)
        if self._begun or self._backlog:
            # Closing a port whose peer takes nothing would wait for it up to half a minute.
            with suppress(OSError, termios.error):
                termios.tcflush(self._fd, termios.TCOFLUSH)
        self._begun = b""
        self._backlog.clear()
        self._fd = -1
        with suppress(OSError, serial.SerialException):
            self._serial.close()
        self._serial = None

    def _readable(self) -> None:
        try:
            data = os.read(self._fd, _READ_BYTES)
        except (BlockingIOError, InterruptedError):
            return
        except OSError as error:
            self._hang_up(error.strerror or str(error))
            return
        if data:
            self._received(data)
        else:
            self._hang_up("end of file")

    def _write_first(self, frame: bytes) -> None:
        """Write a frame when nothing waits before it; keep what the driver does not take."""
        assert self._loop is not None
        try:
            taken = os.write(self._fd, frame)
        except (BlockingIOError, InterruptedError):
            taken = 0
        except OSError as error:
            # Reported from the loop: the caller is in the middle of its own bookkeeping.
            self._loop.call_soon(self._hang_up, error.strerror or str(error))
            return
        if taken == len(frame):
            return
        if taken:
            self._begun = frame[taken:]
        else:
            self._backlog.append(frame)
        self._loop.add_writer(self._fd, self._writable)

    def _writable(self) -> None:
        self._leaving()
        while self._begun or self._backlog:
            frame = self._begun or self._backlog[0]
            try:
                taken = os.write(self._fd, frame)
            except (BlockingIOError, InterruptedError):
                return
            except OSError as error:
                self._hang_up(error.strerror or str(error))
                return
            if not self._begun and taken:
                self._backlog.popleft()
            if taken:
                self._begun = frame[taken:]
            if self._begun or not taken:
                return
        assert self._loop is not None
        self._loop.remove_writer(self._fd)

    def _hang_up(self, reason: str) -> None:
        if self._fd < 0:
            return
        log.warning("%s: hung up (%s)", self.path, reason)
        self.close()
        self._lost(f"the port has vanished ({reason})")


def retry_pauses() -> Iterator[float]:
    """Yield how long to wait before each further try at what was lost: 0.1, 0.2 … 1.6, then 2 s for ever."""
    pause = _FIRST_RETRY_S
    while True:
        yield pause
        pause = min(2 * pause, _LAST_RETRY_S)


def open_serial(path: str, baud: int) -> serial.Serial:
    """Return the opened, configured, non-blocking port; raises PortError with one line saying what is wrong."""
    try:
        mode = os.stat(path).st_mode
    except FileNotFoundError:
        raise PortError(path, "no such port") from None
    except OSError as error:
        raise PortError(path, error.strerror or str(error)) from None
    if not stat.S_ISCHR(mode):
        raise PortError(path, "not a serial port")
    try:
        port = serial.Serial(path, baud, timeout=0, write_timeout=0, exclusive=True)
        _configure(port)
    except ValueError as error:
        raise PortError(path, f"baud rate {baud} not possible ({error})") from None
    except (OSError, termios.error) as error:
        raise PortError(path, _reason(path, error)) from None
    return port


def _configure(port: serial.Serial) -> None:
    # With VMIN 0 an empty read would mean "nothing yet" as well as "hung up".
    attributes = termios.tcgetattr(port.fileno())
    attributes[6][termios.VMIN] = 1
    attributes[6][termios.VTIME] = 0
    termios.tcsetattr(port.fileno(), termios.TCSANOW, attributes)
    os.set_blocking(port.fileno(), False)
    try:
        port.set_low_latency_mode(True)
    except (OSError, ValueError, NotImplementedError, termios.error) as error:
        log.debug("%s: no low-latency mode (%s)", port.port, error)


def _reason(path: str, error: Exception) -> str:
    # pyserial reports "not a tty" with a termios.error as the cause and no number of its own.
    cause = error.__context__ if isinstance(error.__context__, termios.error) else error
    number = cause.args[0] if isinstance(cause, termios.error) else getattr(error, "errno", None)
    if number in (errno.EACCES, errno.EPERM):
        group = _group_of(path)
        return f"permission denied (the port belongs to group {group}: add yourself to it)"
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"busy: {_holder_of(path)} has it open"
    if number == errno.ENOTTY:
        return "not a serial port"
    return os.strerror(number) if number else str(error)


def _group_of(path: str) -> str:
    with suppress(KeyError, OSError):
        return grp.getgrgid(os.stat(path).st_gid).gr_name
    return "?"


def _holder_of(path: str) -> str:
    """Name and number of the process that has locked the port, as far as /proc knows."""
    with suppress(OSError):
        port = os.stat(path)
        number = f"{os.major(port.st_dev):02x}:{os.minor(port.st_dev):02x}:{port.st_ino}"
        for line in Path("/proc/locks").read_text().splitlines():
            # 1: FLOCK  ADVISORY  WRITE 1234 00:1a:5 0 EOF
            lock = line.split()
            if number in lock:
                process = lock[lock.index(number) - 1]
                return f"{Path(f'/proc/{process}/comm').read_text().strip()} (process {process})"
    return "another program"
