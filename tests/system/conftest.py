"""The emulators as a process of their own."""

import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path

import pytest

BIN = Path(sys.executable).parent


@contextmanager
def serve(folder: Path, bench: str) -> Iterator[Path]:
    (folder / "bench.toml").write_text(bench)
    links = folder / "sim"
    command = ["run", "--config", folder / "bench.toml", "--links", links, "--seed", "1"]
    with subprocess.Popen([BIN / "sim-devices", *command], stdout=subprocess.PIPE, text=True) as served:
        assert served.stdout is not None
        try:
            assert "ready\n" in iter(served.stdout.readline, "")
            yield links
        finally:
            served.terminate()
            assert served.wait(timeout=30) == 0


@pytest.fixture(scope="session")
def serving() -> Callable[[Path, str], AbstractContextManager[Path]]:
    """`with serving(folder, bench_toml) as links:` the emulators run and are there; then they end."""
    return serve
