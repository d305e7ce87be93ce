"""The packages' public names: what the type checker is shown is what there is, and nothing heavy comes with it."""

import ast
import subprocess
import sys
from importlib import import_module
from pathlib import Path

import pytest

import perception.camera


def shown_names(package: str) -> set[str]:
    """The names that the package's imports for the type checker bring."""
    tree = ast.parse(Path(str(import_module(package).__file__)).read_text())
    branch = next(node for node in tree.body if isinstance(node, ast.If))
    return {alias.name for node in branch.body if isinstance(node, ast.ImportFrom) for alias in node.names}


@pytest.mark.parametrize("package", ["perception.camera", "perception.depth"])
def test_every_name_that_the_type_checker_is_shown_is_there(package: str) -> None:
    names = shown_names(package)
    assert len(names) > 10
    for name in names:
        assert getattr(import_module(package), name) is not None


def test_a_name_that_is_not_public_is_an_error_as_in_any_module() -> None:
    with pytest.raises(AttributeError, match=r"'perception\.camera' has no attribute 'Kamera'"):
        perception.camera.Kamera  # type: ignore[attr-defined]  # noqa: B018


@pytest.mark.parametrize(
    ("statement", "unwanted"),
    [
        ("import perception.camera", "numpy, asyncio, cv2"),
        ("from perception.camera import CameraError", "numpy, asyncio, cv2"),
        ("from perception.depth import OptionError", "numpy, asyncio, cv2"),
        ("from perception.camera import CaptureSettings, open_camera, paired", "cv2"),
    ],
)
def test_a_name_costs_no_more_than_its_own_module(statement: str, unwanted: str) -> None:
    script = f"import sys; {statement}; sys.exit(any(name in sys.modules for name in {unwanted.split(', ')}))"
    assert subprocess.run([sys.executable, "-c", script], check=False).returncode == 0
