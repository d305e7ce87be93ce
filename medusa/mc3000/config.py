"""The configuration of a head on MC3000 boards: typed, range-checked, degrees in keys and radians in properties.

Every key is required: nothing that can hurt people or the machine has a default. `medusa.config` reads and
writes the TOML; `head.toml` beside it explains each key.
"""

import math
from importlib import resources
from typing import Annotated, Literal

import msgspec
from msgspec import Meta

from medusa.mc3000.board import FilterBytes, Mode

CHIP_CLOCK_HZ = 2_000_000
"""Clock of the HCTL-1100 on the board; the HELLO of each board is compared with it."""

Byte = Annotated[int, Meta(ge=0, le=255)]
Degrees = Annotated[float, Meta(ge=-180.0, le=180.0)]
PositiveDegrees = Annotated[float, Meta(gt=0.0, le=90.0)]


class FilterConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Bytes of the chip's filter D(z) = (K/4)(z − A/256)/(z + B/256) and its sample timer T."""

    A: Byte
    B: Byte
    K: Byte
    T: Annotated[int, Meta(ge=7, le=255)]

    @property
    def filter(self) -> FilterBytes:
        """The same four bytes as the board's driver takes them."""
        return FilterBytes(self.A, self.B, self.K, self.T)

    @property
    def sample_period(self) -> float:
        """Sample period 16 (T + 1)/f_clk, s (docs/protocols, HCTL-1100)."""
        return 16 * (self.T + 1) / CHIP_CLOCK_HZ


class Filters(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The filter of each control mode."""

    position: FilterConfig
    proportional_velocity: FilterConfig
    integral_velocity: FilterConfig

    def of(self, mode: Mode) -> FilterConfig:
        """The filter meant for a control mode; `mode` is not IDLE."""
        return {
            Mode.POSITION: self.position,
            Mode.PROPORTIONAL_VELOCITY: self.proportional_velocity,
            Mode.INTEGRAL_VELOCITY: self.integral_velocity,
        }[mode]


class AxisConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One joint: where it is wired, its scale and sign, what it may do, how it homes."""

    board: Annotated[int, Meta(ge=1, le=0x7E)]
    channel: Annotated[int, Meta(ge=0, le=2)]
    amplifier: Annotated[int, Meta(ge=1, le=0x3F)]
    counts_per_degree: Annotated[float, Meta(gt=0.0, le=20000.0)]
    sign: Literal[-1, 1]
    soft_min_deg: Degrees
    soft_max_deg: Degrees
    max_speed_deg_s: Annotated[float, Meta(gt=0.0, le=1000.0)]
    acceleration_deg_s2: Annotated[float, Meta(gt=0.0, le=20000.0)]
    following_limit_deg: PositiveDegrees
    settle_counts: Annotated[int, Meta(ge=1, le=1000)]
    home_edge_deg: Degrees
    home_deg: Degrees
    park_deg: Degrees
    search_speed_deg_s: Annotated[float, Meta(gt=0.0, le=90.0)]
    approach_speed_deg_s: Annotated[float, Meta(gt=0.0, le=20.0)]
    retract_deg: Annotated[float, Meta(gt=0.0, le=30.0)]
    filters: Filters

    @property
    def counts_per_radian(self) -> float:
        """Encoder counts per joint radian, without the sign: E of thesis (6.7)."""
        return math.degrees(self.counts_per_degree)

    @property
    def soft_limits(self) -> tuple[float, float]:
        """Least and greatest joint angle, rad."""
        return math.radians(self.soft_min_deg), math.radians(self.soft_max_deg)

    @property
    def max_speed(self) -> float:
        """Greatest joint speed, rad/s."""
        return math.radians(self.max_speed_deg_s)

    @property
    def acceleration(self) -> float:
        """Acceleration of profiles and of the integral velocity mode, rad/s²."""
        return math.radians(self.acceleration_deg_s2)

    @property
    def following_limit_counts(self) -> int:
        """FOLLOWING as the board takes it."""
        return round(self.following_limit_deg * self.counts_per_degree)

    @property
    def search_speed(self) -> float:
        """Speed of the coarse search for the home sensor, rad/s."""
        return math.radians(self.search_speed_deg_s)

    @property
    def approach_speed(self) -> float:
        """Speed of the slow approach to the home sensor, rad/s."""
        return math.radians(self.approach_speed_deg_s)

    @property
    def home_edge(self) -> float:
        """Joint angle at which the home sensor switches, rad."""
        return math.radians(self.home_edge_deg)

    @property
    def home_angle(self) -> float:
        """Joint angle to which homing moves at its end, rad."""
        return math.radians(self.home_deg)

    @property
    def park_angle(self) -> float:
        """Joint angle of the parked head, rad."""
        return math.radians(self.park_deg)


class PortsConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The two serial lines; a path may be left out and given on the command line."""

    boards: str | None = None
    amplifiers: str | None = None
    baud: Literal[9600, 19200, 38400, 57600, 115200, 230400, 460800, 921600] = 115200


class SafetyConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """What stops the machine when the host cannot."""

    board_watchdog_ms: Annotated[int, Meta(ge=50, le=5000)]
    board_watchdog_action: Literal["idle", "ramp"]
    amplifier_watchdog_ms: Annotated[int, Meta(ge=0, le=60000)]


class HomingConfig(msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """Groups of joints in the order in which they home; the joints of one group home together."""

    order: tuple[tuple[str, ...], ...]


class Mc3000Config(
    msgspec.Struct, frozen=True, kw_only=True, forbid_unknown_fields=True, tag_field="drive", tag="mc3000"
):
    """A head on MC3000 boards: `axes` has its joints by name, in the order of the file.

    `file` is where it was read, None for one made in the program (the simulated head's).
    """

    ports: PortsConfig
    safety: SafetyConfig
    homing: HomingConfig
    axes: dict[str, AxisConfig]
    file: str | None = None

    @property
    def board_addresses(self) -> tuple[int, ...]:
        """Addresses of the boards that carry a joint, ascending."""
        return tuple(sorted({axis.board for axis in self.axes.values()}))

    @property
    def ramp_seconds(self) -> float:
        """The longest programmed deceleration of any joint, from its greatest speed, s."""
        return max(axis.max_speed / axis.acceleration for axis in self.axes.values())

    def with_axis(self, name: str, **changes: object) -> "Mc3000Config":
        """A copy in which one joint differs, not range-checked: for experiments."""
        axis = msgspec.structs.replace(self.axes[name], **changes)
        return msgspec.structs.replace(self, axes={**self.axes, name: axis})


def template() -> str:
    """The commented configuration of a head on MC3000 boards, its hazardous keys empty."""
    return resources.files("medusa.mc3000").joinpath("head.toml").read_text(encoding="utf-8")
