"""A mistake in a configuration is one line that names file, key, value and what is allowed, whatever its type."""

from pathlib import Path
from typing import Annotated, Literal

import msgspec
import pytest
from msgspec import Meta

from medusa.errors import ConfigError
from medusa.files.configuration import fill, parse, read_text


class Wheel(msgspec.Struct, forbid_unknown_fields=True):
    counts: Annotated[int, Meta(ge=1)]
    radius_mm: Annotated[float, Meta(gt=0.0, le=500.0)] = 75.0
    base_mm: Annotated[float, Meta(ge=50.0, le=500.0)] = 340.0


class Cart(msgspec.Struct, forbid_unknown_fields=True):
    wheel: Wheel
    order: tuple[tuple[Literal["left", "right"], ...], ...] = ()
    port: str | None = None
    file: str | None = None


@pytest.mark.parametrize(
    ("text", "complaint"),
    [
        ("wheel.counts = 0", "wheel.counts = 0: an integer from 1"),
        ("wheel = { counts = 1, radius_mm = 0 }", "wheel.radius_mm = 0: a number from more than 0 to 500"),
        (
            "wheel = { counts = 1, base_mm = 0.34 }",
            "wheel.base_mm = 0.34: a number from 50 to 500; 0.34 looks like metres, the key is in millimetres",
        ),
        ("wheel = {}", "wheel.counts is missing: an integer from 1"),
        ("wheel = 3", "wheel = 3: a table"),
        ("wheel.counts = ''", "wheel.counts = '': has to be filled in: an integer from 1"),
        ("wheel.counts = 1\norder = 'left'", "order = 'left': a list"),
        ("order = [['left'], ['up']]\nwheel.counts = 1", "order[1][0] = 'up': one of 'left', 'right'"),
        ("wheel.counts = 1\nport = 3", "port = 3: a text"),
        ("wheel.counts = 1\nspeed = 3", "speed = 3: no such key is known"),
        ("wheel.counts = 1\nfile = 'x'", "file = 'x': no such key is known"),
    ],
)
def test_a_mistake_is_one_line(text: str, complaint: str) -> None:
    with pytest.raises(ConfigError) as refused:
        parse(text, Cart, "cart.toml")
    assert str(refused.value) == f"cart.toml: {complaint}"


def test_what_is_no_toml_or_no_text_is_named(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"^cart\.toml: is not TOML: "):
        parse("wheel = = 1", Cart, "cart.toml")
    path = tmp_path / "cart.toml"
    path.write_bytes(b"\xff\xfe")
    with pytest.raises(ConfigError, match="is not UTF-8 text"):
        read_text(path)


def test_keys_are_filled_in_and_comments_kept() -> None:
    filled = fill('[wheel]\ncounts = ""  # of the encoder\n', {"wheel.counts": 3})
    assert filled == "[wheel]\ncounts = 3  # of the encoder\n"
    with pytest.raises(KeyError):
        fill("[wheel]\n", {"wheel.counts": 3})
