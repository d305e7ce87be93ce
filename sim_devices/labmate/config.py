"""What a base is: its true geometry, its surroundings, its options. Defaults are the page's (docs/protocols)."""

from typing import Annotated, Literal

import msgspec
from msgspec import Meta

Wheel = Literal["left", "right"]
Side = Literal["front", "rear", "left", "right"]
Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]


class Box(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A box on the floor: its centre, its extent along and across its own axis (m), its yaw.

    One that is `low` passes under the bumpers and meets the wheels' frame behind them.
    """

    x: float
    y: float
    length: Positive
    width: Positive
    yaw_deg: float = 0.0
    low: bool = False


class Bump(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A round obstacle of a height (m) that a wheel rolls over, at a rolled distance of that wheel (m)."""

    wheel: Wheel
    at: float
    height: Annotated[float, Meta(gt=0, lt=0.07)] = 0.010


class BaseConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One `[[base]]` of the bench's file. Lengths in metres; walls are x1, y1, x2, y2."""

    address: Annotated[int, Meta(ge=0x01, le=0x7E)] = 0x10
    line: str = "labmate"
    start_x: float = 0.0
    start_y: float = 0.0
    start_heading_deg: float = 0.0
    wheel_base: Positive = 0.3372
    """The effective one; the base computes with 0.340."""
    diameter_ratio: Annotated[float, Meta(gt=0.5, lt=2)] = 1.00121
    """Right by left; the mean of the two is the nominal diameter."""
    slip_left: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    """The part of the rolled way that is lost on the floor."""
    slip_right: Annotated[float, Meta(ge=0, lt=1)] = 0.0
    bumps: list[Bump] = []
    length: Positive = 0.75
    width: Positive = 0.70
    bumper_travel: Positive = 0.015
    """How far a bumper gives way before the frame stands against the obstacle."""
    walls: list[tuple[float, float, float, float]] = []
    boxes: list[Box] = []
    battery: Annotated[float, Meta(gt=0, le=65.535)] = 24.0
    """Volts at power-up."""
    battery_volts_per_ampere_hour: NotNegative = 0.05
