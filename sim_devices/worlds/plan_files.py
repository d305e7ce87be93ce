"""Plans by name or by file: the ones that come with the emulators are TOML files in ``plans/``."""

from pathlib import Path
from typing import Any

import msgspec

from sim_devices.config import ConfigError, convert, read_toml
from sim_devices.worlds.plan import Plan, TextureConfig

_FOLDER = Path(__file__).parent / "plans"


def plan_names() -> list[str]:
    """The names of the plans that come with the emulators."""
    return sorted(path.stem for path in _FOLDER.glob("*.toml"))


def read_plan(source: str | Path, *, contrast: float | None = None) -> Plan:
    """Read a plan by its name or its file; ``contrast`` replaces that of its general texture.

    Raises ConfigError of one line: the file, key and value, and what is allowed.
    """
    path = _FOLDER / f"{source}.toml" if str(source) in plan_names() else Path(source)
    if path.suffix != ".toml" and not path.exists():
        names = ", ".join(plan_names())
        raise ConfigError(f"no plan is called {str(source)!r}; there are {names}, or the path of a TOML file")
    data = read_toml(path)
    _find_files(path, data, "")
    plan = convert(path, data, Plan)
    if contrast is None:
        return plan
    general = {**msgspec.to_builtins(plan.texture), "contrast": contrast}
    texture = convert(path, general, TextureConfig, "texture")
    return msgspec.structs.replace(plan, texture=texture)


def _find_files(path: Path, data: Any, key: str) -> None:
    """Let every texture's file be relative to the plan's own folder."""
    if isinstance(data, list):
        for i, item in enumerate(data):
            _find_files(path, item, f"{key}[{i}]")
    elif isinstance(data, dict):
        for name, item in data.items():
            _find_files(path, item, f"{key}.{name}" if key else name)
        if isinstance(data.get("file"), str):
            picture = path.parent / data["file"]
            if not picture.is_file():
                raise ConfigError(f"{path}: {key}.file = {data['file']!r}: there is no such picture")
            data["file"] = str(picture)
