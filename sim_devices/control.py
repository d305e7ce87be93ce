"""The control channel: a unix socket, its owner's alone, on which a running bench is inspected and disturbed.

One JSON object a line: {"verb": "inspect"} or {"verb": "head.restart", "arguments": {"board": 1}}; the answer
is {"result": …} or {"error": "…"}. There is a fixed list of verbs: nothing else is ever called.
"""

import asyncio
import contextlib
import json
import logging
import os
import socket
from pathlib import Path
from typing import Any

from sim_devices.bench import Bench, UnknownVerb

log = logging.getLogger(__name__)

SOCKET_NAME = "control"
_LONGEST_PATH = 107
_ANSWER_S = 10.0


class ControlError(Exception):
    """The bench cannot be reached, or refused the verb."""


class ControlServer:
    """Serves `inspect`, `verbs` and the bench's verbs: `async with ControlServer(bench, directory): …`."""

    def __init__(self, bench: Bench, directory: Path) -> None:
        self._bench = bench
        self.path = directory / SOCKET_NAME
        self._server: asyncio.Server | None = None
        self._inode: int | None = None

    async def __aenter__(self) -> "ControlServer":
        listener = _listen(self.path)
        self._inode = self.path.stat().st_ino
        self._server = await asyncio.start_unix_server(self._serve, sock=listener)
        return self

    async def __aexit__(self, *exc_info: object) -> None:
        if self._server is not None:
            self._server.close()
        with contextlib.suppress(OSError):
            if self.path.stat().st_ino == self._inode:
                self.path.unlink()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        try:
            while line := await reader.readline():
                writer.write(json.dumps(self._answer(line)).encode() + b"\n")
                await writer.drain()
        except (ConnectionError, ValueError) as error:
            log.debug("control client: %s", error)
        finally:
            writer.close()

    def _answer(self, line: bytes) -> dict[str, Any]:
        try:
            request = json.loads(line)
            verb, arguments = request["verb"], request.get("arguments", {})
            if not isinstance(verb, str) or not isinstance(arguments, dict):
                raise TypeError
        except (ValueError, TypeError, KeyError, AttributeError):
            return {"error": 'a line must be {"verb": "…", "arguments": {…}}'}
        try:
            if verb == "inspect":
                return {"result": self._bench.state()}
            if verb == "verbs":
                return {"result": self._bench.describe_verbs()}
            return {"result": self._bench.inject(verb, **arguments)}
        except (UnknownVerb, ValueError, TypeError, OSError) as error:
            return {"error": f"{verb}: {error}" if isinstance(error, TypeError) else str(error)}
        except Exception:
            log.exception("verb %s failed", verb)
            return {"error": f"{verb} failed; the bench's log says how"}


def _listen(path: Path) -> socket.socket:
    """Bind the socket with mode 0600 from its first instant; refuse a place that a live bench serves."""
    if len(os.fsencode(path)) > _LONGEST_PATH:
        raise ControlError(f"{path}: a socket's path has at most {_LONGEST_PATH} bytes; choose a shorter DIR")
    if path.is_socket():
        if _answers(path):
            raise ControlError(f"{path}: another sim-devices serves this directory")
        path.unlink()
    listener = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    mask = os.umask(0o177)
    try:
        listener.bind(str(path))
    except OSError:
        listener.close()
        raise
    finally:
        os.umask(mask)
    return listener


def _answers(path: Path) -> bool:
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as probe:
        probe.settimeout(1.0)
        try:
            probe.connect(str(path))
        except OSError:
            return False
    return True


def call(directory: Path, verb: str, arguments: dict[str, Any] | None = None) -> Any:
    """Ask a running bench; raises ControlError."""
    path = directory / SOCKET_NAME
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as client:
        client.settimeout(_ANSWER_S)
        try:
            client.connect(str(path))
            client.sendall(json.dumps({"verb": verb, "arguments": arguments or {}}).encode() + b"\n")
            with client.makefile("rb") as stream:
                answer = json.loads(stream.readline() or b"{}")
        except TimeoutError:
            raise ControlError(f"{path}: no answer in {_ANSWER_S:.0f} s") from None
        except OSError as error:
            raise ControlError(f"{path}: {error.strerror or error}; is sim-devices running?") from None
        except ValueError:
            raise ControlError(f"{path}: the answer is no JSON") from None
    if "error" in answer:
        raise ControlError(answer["error"])
    if "result" not in answer:
        raise ControlError(f"{path}: hung up without an answer")
    return answer["result"]
