"""A record of what went over a line: time, direction, bytes, meaning."""

from collections.abc import Mapping
from pathlib import Path


class Trace:
    """A wire trace in a text file; a full disk ends the trace with one warning, never the machine."""

    def __init__(self, path: str | Path, *, names: Mapping[int, str] | None = None) -> None:
        raise NotImplementedError

    def record(self, time: float, line: str, direction: str, data: bytes, meaning: str) -> None:
        """Write one line: `direction` is `>` (host to device) or `<`; `line` names the wire."""
        raise NotImplementedError

    def close(self) -> None:
        raise NotImplementedError
