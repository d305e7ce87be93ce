"""Which joints passed the wiring check, kept beside the configuration file."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Self

from medusa.errors import ConfigError
from medusa.files.replace_file import replace_file
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.mark import axis_digest


class CheckRecord:
    """Which joints passed `check` with which configuration on which port, kept beside the configuration file.

    The port belongs to it: what the emulated head passed does not hold for the real one.
    """

    def __init__(self, path: Path | None, port: str, digests: Mapping[str, str]) -> None:
        self._path = path
        self._port = port
        self._digests = dict(digests)

    @classmethod
    def of(cls, config: Mc3000Config, port: str) -> Self:
        """The record beside the configuration's file; a configuration made in the program has none."""
        if config.file is None:
            return cls(None, port, {})
        path = Path(config.file).with_suffix(".checked.json")
        try:
            stored = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            stored = {}
        except (OSError, ValueError) as error:
            raise ConfigError(str(path), "", None, f"the record of checks cannot be read: {error}") from None
        if not isinstance(stored, dict):
            raise ConfigError(str(path), "", None, "the record of checks is not a JSON object")
        return cls(path, port, {str(name): str(digest) for name, digest in stored.items()})

    def holds(self, name: str, config: Mc3000Config) -> bool:
        """True when the joint was checked on this port with exactly this configuration.

        A head described by no file is the simulated one: its wiring is known and cannot have changed.
        """
        return self._path is None or self._digests.get(self._key(name)) == axis_digest(
            name, config.axes[name]
        )

    def _key(self, name: str) -> str:
        return f"{name} on {self._port}"

    def add(self, name: str, config: Mc3000Config) -> None:
        """Record that the joint passed; the file is replaced whole or not at all."""
        if self._path is None:
            return
        self._digests[self._key(name)] = axis_digest(name, config.axes[name])
        replace_file(self._path, json.dumps(self._digests, indent=1, sort_keys=True) + "\n")
