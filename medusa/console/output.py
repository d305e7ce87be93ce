"""What a command writes: JSON documents on stdout, errors and log records as one line each on stderr."""

import contextlib
import json
import logging
import sys
from collections.abc import Mapping
from typing import Any


def print_json(document: Mapping[str, Any]) -> None:
    """The one document on stdout."""
    print(json.dumps(document, indent=1, default=str))


def print_error(
    program: str, message: str, code: int, *, as_json: bool, so_far: Mapping[str, Any] | None = None
) -> None:
    """What went wrong as one line on stderr; `as_json` as the document on stdout, too.

    A terminal or pipe that has gone takes neither, and the exit code still is the true one.
    """
    with contextlib.suppress(OSError):
        print(f"{program}: {message}", file=sys.stderr, flush=True)
    if as_json:
        with contextlib.suppress(OSError):
            print_json({**(so_far or {}), "error": message, "exit_code": code})


def set_up_log(verbose: bool) -> None:
    """Warnings on stderr, one line each and each once; with `verbose` what is being done, too."""
    handler = logging.StreamHandler(sys.stderr)
    handler.addFilter(_Once())
    handler.setFormatter(_OneLine())
    logging.basicConfig(level=logging.INFO if verbose else logging.WARNING, handlers=[handler])


class _Once(logging.Filter):
    """Lets each text through once: a pulled cable is noticed in several places."""

    def __init__(self) -> None:
        super().__init__()
        self._logged: set[str] = set()

    def filter(self, record: logging.LogRecord) -> bool:
        text = record.getMessage()
        if text in self._logged:
            return False
        self._logged.add(text)
        return True


class _OneLine(logging.Formatter):
    """Level and message; of an exception its text, never a traceback."""

    def format(self, record: logging.LogRecord) -> str:
        cause = record.exc_info[1] if record.exc_info else None
        return f"{record.levelname} {record.getMessage()}" + (f": {cause}" if cause else "")
