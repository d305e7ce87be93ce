"""Readings of the base in words, tables and JSON."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from medusa.console import print_table

if TYPE_CHECKING:
    from labmate.base.reading import BaseReading
    from labmate.base.report import MotionReport


def print_values(title: str, document: Mapping[str, Any]) -> None:
    """A document as a table of two columns, its numbers with all their digits."""
    rows = [
        {"": key, "value": str(value) if isinstance(value, float) else value}
        for key, value in document.items()
    ]
    print_table(title, rows)


def snapshot_document(snapshot: BaseReading) -> dict[str, Any]:
    """A snapshot for JSON: m, degrees, V."""
    from math import degrees, sqrt

    from labmate.base.events import Cause
    from labmate.square_report import pose_in_words

    spread, details = snapshot.covariance, snapshot.details
    counts = snapshot.counts
    return {
        "mode": details.get("mode"),
        "moving": details.get("moving", not snapshot.at_rest),
        "bumpers": [side.name.lower() for side in snapshot.touching if side.name],
        "emergency_stop": Cause.EMERGENCY_STOP in snapshot.latched,
        "motor_power": details.get("motor_power"),
        "stalled": Cause.STALLED in snapshot.latched,
        "battery_v": round(snapshot.battery, 3),
        "battery_low": snapshot.battery_low,
        "pose": pose_in_words(snapshot.own_pose),
        "speed_m_s": round(snapshot.speed, 4),
        "turn_rate_deg_s": round(degrees(snapshot.turn_rate), 2),
        "odometry": pose_in_words(snapshot.pose),
        "odometry_deviation": {
            "x_m": round(sqrt(spread[0][0]), 6),
            "y_m": round(sqrt(spread[1][1]), 6),
            "heading_deg": round(degrees(sqrt(spread[2][2])), 4),
        },
        "left_counts": None if counts is None else counts.left,
        "right_counts": None if counts is None else counts.right,
    }


def pose_line(snapshot: BaseReading) -> str:
    """A pose in one line."""
    from math import degrees

    p = snapshot.own_pose
    return f"x {p.x:.4f} m, y {p.y:.4f} m, heading {degrees(p.heading):.2f}°"


def report_document(report: MotionReport) -> dict[str, Any]:
    """A finished GO or TURN for JSON."""
    from math import degrees

    from labmate.square_report import pose_in_words

    unit, scale = ("m", 1.0) if report.kind == "GO" else ("deg", degrees(1.0))
    return {
        "motion": report.kind,
        f"commanded_{unit}": round(scale * report.commanded, 4),
        f"travelled_{unit}": round(scale * report.travelled, 4),
        "ending": report.reason,
        "seconds": round(report.duration, 3),
        "pose": pose_in_words(report.end),
    }
