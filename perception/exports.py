"""The public names of a package, each module imported when one of its names is first asked for.

So the package costs nothing to import, and `from perception.camera import Frame` does not load OpenCV.
"""

from collections.abc import Callable, Mapping
from importlib import import_module
from typing import Any


def export(package: str, modules: Mapping[str, str]) -> Callable[[str], Any]:
    """The `__getattr__` of a package (PEP 562).

    Args:
        package: its `__name__`.
        modules: the public names of each of its modules, separated by spaces.
    """
    homes = {name: module for module, names in modules.items() for name in names.split()}

    def get(name: str) -> Any:
        if name not in homes:
            raise AttributeError(f"module {package!r} has no attribute {name!r}")
        return getattr(import_module(f"{package}.{homes[name]}"), name)

    return get
