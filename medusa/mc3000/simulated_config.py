"""The configuration of the emulated head: the template with its hazardous keys filled in from the pages.

Ranges: docs/protocols, MC3000, "Geometry of the head" (soft limits 2° inside the switches); scales and
speeds: thesis, tables 6.1 and 6.3; filters: the registers nearest to thesis (6.12)–(6.14) and table 6.2 (iii).
"""

from functools import cache
from typing import Any

from medusa.files.configuration import fill, parse
from medusa.mc3000.config import Mc3000Config, template
from medusa.mc3000.config_limits import check_limits

TIMER = 255

_AXES: dict[str, dict[str, Any]] = {
    "pan": {
        "counts_per_degree": 277.778,
        "sign": 1,
        "soft_min_deg": -93.0,
        "soft_max_deg": 93.0,
        "max_speed_deg_s": 180.0,
        "acceleration_deg_s2": 1080.0,
        "home_edge_deg": -20.0,
    },
    "tilt": {
        "counts_per_degree": 555.556,
        "sign": 1,
        "soft_min_deg": -38.0,
        "soft_max_deg": 38.0,
        "max_speed_deg_s": 111.6,
        "acceleration_deg_s2": 540.0,
        "home_edge_deg": -10.0,
    },
    "left_vergence": {
        "counts_per_degree": 322.5805,
        "sign": 1,
        "soft_min_deg": -38.0,
        "soft_max_deg": 38.0,
        "max_speed_deg_s": 180.0,
        "acceleration_deg_s2": 1080.0,
        "home_edge_deg": -15.0,
    },
    "right_vergence": {
        "counts_per_degree": 322.5805,
        "sign": -1,
        "soft_min_deg": -38.0,
        "soft_max_deg": 38.0,
        "max_speed_deg_s": 180.0,
        "acceleration_deg_s2": 1080.0,
        "home_edge_deg": -12.0,
    },
}
_FOLLOWING_DEG = 5.0
_POSITION = {
    "pan": (197, 0, 7),
    "tilt": (220, 0, 5),
    "left_vergence": (225, 0, 5),
    "right_vergence": (225, 0, 5),
}
_PROPORTIONAL = {
    "pan": (0, 0, 15),
    "tilt": (0, 0, 12),
    "left_vergence": (0, 0, 12),
    "right_vergence": (0, 0, 12),
}


def simulated_values() -> dict[str, Any]:
    """Dotted keys of the template and their values for the emulated head."""
    values: dict[str, Any] = {}
    for name, keys in _AXES.items():
        values |= {f"axes.{name}.{key}": value for key, value in keys.items()}
        values[f"axes.{name}.following_limit_deg"] = _FOLLOWING_DEG
        for mode, filters in (
            ("position", _POSITION),
            ("proportional_velocity", _PROPORTIONAL),
            ("integral_velocity", _POSITION),
        ):
            prefix = f"axes.{name}.filters.{mode}"
            values |= {
                f"{prefix}.{letter}": byte
                for letter, byte in zip("ABKT", (*filters[name], TIMER), strict=True)
            }
    return values


def simulated_toml() -> str:
    """The emulated head's configuration file, with the template's comments."""
    return fill(template(), simulated_values())


@cache
def simulated_config() -> Mc3000Config:
    """The emulated head's configuration; read from no file, so its joints count as checked."""
    name = "the simulated head's configuration"
    config = parse(simulated_toml(), Mc3000Config, name)
    check_limits(config, name)
    return config
