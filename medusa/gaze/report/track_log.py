"""What a gaze loop did: a row a sighting, and the figures that sum them up."""

import math
from dataclasses import dataclass, field
from typing import Any

from medusa.gaze.command import Sighting
from medusa.kinematics import Joints


@dataclass(frozen=True)
class TrackRow:
    """One picture: exposure and command [s, loop], joints [rad], the target's tangents, what was decided."""

    stamp: float
    acted: float
    joints: Joints
    left: tuple[float, float] | None
    right: tuple[float, float] | None
    decision: str


@dataclass
class TrackLog:
    """Filled by the loop while it runs; `summary` afterwards."""

    rows: list[TrackRow] = field(default_factory=list)
    saccades: list[tuple[float, float, str]] = field(default_factory=list)
    holds: list[tuple[float, str]] = field(default_factory=list)
    limited: set[str] = field(default_factory=set)
    late_frames: int = 0
    blind_frames: int = 0

    def add(self, sighting: Sighting, acted: float, decision: str) -> None:
        self.rows.append(
            TrackRow(sighting.stamp, acted, sighting.joints, sighting.left, sighting.right, decision)
        )

    @staticmethod
    def retinal_error(row: TrackRow) -> float:
        """Angle between optical axis and target [rad], the larger of the two eyes'; NaN when neither saw it."""
        angles = [math.atan(math.hypot(*eye)) for eye in (row.left, row.right) if eye is not None]
        return max(angles, default=math.nan)

    def summary(self, *, since: float = -math.inf) -> dict[str, Any]:
        """Figures of merit of the pictures exposed after `since`: errors in degrees, latency in milliseconds."""
        rows = [row for row in self.rows if row.stamp >= since]
        errors = [math.degrees(e) for e in map(self.retinal_error, rows) if not math.isnan(e)]
        vergence = [
            abs(math.degrees(math.atan(row.left[0]) - math.atan(row.right[0])))
            for row in rows
            if row.left is not None and row.right is not None
        ]
        latencies = sorted(row.acted - row.stamp for row in rows)
        return {
            "pictures": len(rows),
            "seen": len(errors),
            "rms_error_deg": math.sqrt(sum(e * e for e in errors) / len(errors)) if errors else None,
            "median_error_deg": _middle(errors),
            "peak_error_deg": max(errors, default=None),
            "median_vergence_error_deg": _middle(vergence),
            "median_latency_ms": None if not latencies else 1e3 * latencies[len(latencies) // 2],
            "saccades": len([start for start, _, _ in self.saccades if start >= since]),
            "late_frames": self.late_frames,
            "blind_frames": self.blind_frames,
            "limited": sorted(self.limited),
        }


def _middle(values: list[float]) -> float | None:
    return sorted(values)[len(values) // 2] if values else None
