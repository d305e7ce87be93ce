"""A board's snapshot as joint states, and the configuration as traits and capabilities."""

from typing import Any

from medusa.head.drive import Capabilities, JointState, JointTraits
from medusa.head.faults import Cause
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import AxisSnapshot, Flags, Inputs, Mode
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.joint import VELOCITY_MODES

LATCHES = {
    Inputs.LIMIT_LATCHED: Cause.LIMIT,
    Inputs.EMERGENCY_STOP_LATCHED: Cause.EMERGENCY_STOP,
    Inputs.FAULT_LATCHED: Cause.DRIVE,
}


def capabilities(config: Mc3000Config) -> Capabilities:
    """What MC3000 boards can do with this configuration."""
    slowest = max(axis.filters.position.sample_period for axis in config.axes.values())
    return Capabilities(
        # Each board has its own clock's phase and its own START frame.
        start_skew=2 * slowest,
        end_skew=2 * slowest,
        stamp_error=0.005,
        # At the next feeding at the latest, and an event's first repeat.
        notice=config.safety.board_watchdog_ms / 3000 + 0.1,
        watchdog=config.safety.board_watchdog_ms / 1000,
        keeps_limits=False,
        retargets=False,
        homing="search",
        emergency="limp",
        latch="device",
    )


def traits_of(axis: Axis) -> JointTraits:
    """What an axis may do, from its configuration."""
    config = axis.config
    counts = config.counts_per_radian
    low, high = config.soft_limits
    return JointTraits(
        low=low,
        high=high,
        speed=config.max_speed,
        acceleration=config.acceleration,
        resolution=1 / counts,
        rate_step=1 / (counts * config.filters.integral_velocity.sample_period),
        settle=config.settle_counts / counts,
        largest_step=(config.following_limit_counts - 1) / counts,
        park=config.park_angle,
    )


def state_of(axis: Axis, snapshot: AxisSnapshot, time: float) -> JointState:
    """An axis as its board showed it at `time` (loop, s)."""
    mode = snapshot.mode
    profile = mode is Mode.POSITION and bool(snapshot.flags & Flags.PROFILE)
    return JointState(
        time=time,
        angle=axis.to_angle(snapshot.actual),
        raw=snapshot.actual / axis.counts_per_radian,
        commanded=axis.to_angle(snapshot.command),
        rate=axis.rate,
        moving=mode in VELOCITY_MODES or profile,
        enabled=mode is not Mode.IDLE or snapshot.motor_command != 0,
        homed=axis.homed,
        latched=frozenset(cause for bit, cause in LATCHES.items() if snapshot.inputs & bit),
        device=snapshot,
    )


def details_of(joint: JointState) -> dict[str, Any]:
    """What only this machine has, for status and documents."""
    snapshot: AxisSnapshot = joint.device
    return {
        "mode": snapshot.mode.name.lower().replace("_", " "),
        "position_counts": snapshot.actual,
        "command_counts": snapshot.command,
        "motor_command": snapshot.motor_command,
        "inputs": _names(snapshot.inputs),
    }


def _names(inputs: Inputs) -> str:
    return ", ".join(str(flag.name).lower().replace("_", " ") for flag in inputs) or "–"
