"""A record of what went over a line: time, direction, bytes, meaning."""

import logging
from pathlib import Path
from typing import Final, TextIO

log = logging.getLogger(__name__)

TO_DEVICE: Final = ">"
TO_HOST: Final = "<"
# What was written reaches the disk at least this often, so that little is missing after a kill.
_FLUSH_S: Final = 0.25


class Trace:
    """A wire trace in a text file; a full disk ends the trace with one warning, never the machine."""

    def __init__(self, path: str | Path) -> None:
        """Begin a new trace file; raises OSError when it cannot be made."""
        self.path = Path(path)
        self._file: TextIO | None = self.path.open("w", encoding="utf-8")
        self._flushed = 0.0

    def record(self, time: float, line: str, direction: str, data: bytes, meaning: str) -> None:
        """Write one line: `direction` is `>` (host to device) or `<`; `line` names the wire."""
        if self._file is None:
            return
        try:
            self._file.write(f"{time:.6f} {line} {direction} {data.hex()} {meaning}\n")
            if time - self._flushed >= _FLUSH_S:
                self._flushed = time
                self._file.flush()
        except OSError as error:
            self._give_up(error)

    def close(self) -> None:
        """Finish the file."""
        if self._file is None:
            return
        try:
            self._file.close()
        except OSError as error:
            self._give_up(error)
        self._file = None

    def _give_up(self, error: OSError) -> None:
        log.warning("%s: %s; the trace ends here", self.path, error.strerror or error)
        file, self._file = self._file, None
        if file is not None:
            try:
                file.close()
            except OSError:
                log.debug("%s: not closed cleanly", self.path)
