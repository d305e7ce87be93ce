"""What the emulated head is made of: the pages' values, and what a TOML file may change."""

from typing import Annotated

from msgspec import Meta, Struct
from msgspec.structs import replace

JOINTS = ("pan", "tilt", "left_vergence", "right_vergence")

Positive = Annotated[float, Meta(gt=0)]
NotNegative = Annotated[float, Meta(ge=0)]


class JointConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """One joint: motor, power stage and geometry. `gain` is C in counts/s per DAC count."""

    counts_per_radian: Positive
    time_constant_ms: Positive
    gain: Positive
    amplifier_gain: Positive
    stop_deg: Annotated[float, Meta(gt=5, le=180)]
    sensor_edge_deg: Annotated[float, Meta(gt=-180, lt=180)]
    mirrored: bool = False


PAN = JointConfig(
    counts_per_radian=15915.5,
    time_constant_ms=7.835792,
    gain=431.30146,
    amplifier_gain=3.56,
    stop_deg=100.0,
    sensor_edge_deg=-20.0,
)
TILT = JointConfig(
    counts_per_radian=31831.0,
    time_constant_ms=13.578841,
    gain=1013.86549,
    amplifier_gain=1.95,
    stop_deg=45.0,
    sensor_edge_deg=-10.0,
)
LEFT_VERGENCE = JointConfig(
    counts_per_radian=18482.5,
    time_constant_ms=16.020856,
    gain=1235.08619,
    amplifier_gain=1.0,
    stop_deg=45.0,
    sensor_edge_deg=-15.0,
)
RIGHT_VERGENCE = replace(LEFT_VERGENCE, sensor_edge_deg=-12.0, mirrored=True)


class HeadConfig(Struct, frozen=True, kw_only=True, forbid_unknown_fields=True):
    """The head as its pages describe it, unless told otherwise; `start_deg` fixes joints' power-up angles."""

    pan: JointConfig = PAN
    tilt: JointConfig = TILT
    left_vergence: JointConfig = LEFT_VERGENCE
    right_vergence: JointConfig = RIGHT_VERGENCE
    switch_inset_deg: Annotated[float, Meta(gt=0, lt=45)] = 5.0
    friction_counts: NotNegative = 0.0
    backlash_deg: Annotated[float, Meta(ge=0, le=1)] = 0.0
    bus_voltage: NotNegative = 48.0
    resistance: Positive = 4.0
    peak_current: Positive = 20.0
    continuous_current: Positive = 10.0
    foldback_s: Positive = 2.0
    start_deg: dict[str, float] = {}

    def __post_init__(self) -> None:
        for name in JOINTS:
            joint: JointConfig = getattr(self, name)
            switch_deg = self.switch_deg(name)
            if not -switch_deg < joint.sensor_edge_deg < switch_deg:
                raise ValueError(
                    f"{name}.sensor_edge_deg is {joint.sensor_edge_deg}, the switches are at ±{switch_deg}"
                )
        for name, start_deg in self.start_deg.items():
            if name not in JOINTS:
                raise ValueError(f"start_deg.{name}: no such joint; there are {', '.join(JOINTS)}")
            stop_deg = getattr(self, name).stop_deg
            if not -stop_deg < start_deg < stop_deg:
                raise ValueError(f"start_deg.{name} is {start_deg}, the stops are at ±{stop_deg}")
        if self.continuous_current > self.peak_current:
            raise ValueError(
                f"continuous_current is {self.continuous_current} A, peak_current {self.peak_current} A"
            )

    def switch_deg(self, name: str) -> float:
        """Return the limit switches' angle of a joint, ± this many degrees."""
        joint: JointConfig = getattr(self, name)
        return joint.stop_deg - self.switch_inset_deg
