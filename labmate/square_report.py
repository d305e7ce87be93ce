"""The square experiment on paper: figures of merit, a record to calibrate from later, and the picture."""

from __future__ import annotations

import json
from collections.abc import Sequence
from math import degrees
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from labmate.calibration import DIRECTIONS, Calibration, Direction
from labmate.odometry import Pose, WheelGeometry
from labmate.square import SquareResult, SquareRun, true_end
from medusa.errors import ConfigError
from medusa.files.replace_file import replace_file

RECORD_NAME = "square.json"
FIGURE_NAME = "square.png"
CALIBRATION_NAME = "labmate-calibration.toml"

_TRUE, _ODOMETRY, _CALIBRATED, _AGAIN = "#222222", "#c8553d", "#4aa3df", "#7fb069"


def pose_in_words(pose: Pose) -> dict[str, float]:
    """A pose for JSON: m and degrees."""
    return {"x_m": round(pose.x, 6), "y_m": round(pose.y, 6), "heading_deg": round(degrees(pose.heading), 4)}


def summary(result: SquareResult, true: WheelGeometry | None = None) -> dict[str, Any]:
    """Figures of merit; `true` is the emulated base's real geometry, where it is known."""
    found = result.calibration
    document: dict[str, Any] = {
        "side_m": result.side,
        "nominal": {"wheel_base_mm": 1e3 * result.nominal.wheel_base, "wheel_ratio": 1.0},
        "calibration": calibration_in_words(found),
        "runs": [_run_in_words(result, run) for run in (*result.uncalibrated, *result.calibrated)],
    }
    if true is not None:
        document["true"] = {"wheel_base_mm": 1e3 * true.wheel_base, "wheel_ratio": true.wheel_ratio}
        document["calibration_error"] = {
            "wheel_base_mm": round(1e3 * (found.wheel_base - true.wheel_base), 5),
            "wheel_ratio": round(found.wheel_ratio - true.wheel_ratio, 9),
        }
    return document


def calibration_in_words(found: Calibration) -> dict[str, float]:
    """A calibration for JSON: mm."""
    return {
        "wheel_base_mm": round(1e3 * found.wheel_base, 4),
        "wheel_base_deviation_mm": round(1e3 * found.wheel_base_deviation, 4),
        "wheel_ratio": round(found.wheel_ratio, 8),
        "wheel_ratio_deviation": round(found.wheel_ratio_deviation, 8),
    }


def _run_in_words(result: SquareResult, run: SquareRun) -> dict[str, Any]:
    closing = result.closing(run)
    return {
        "direction": run.direction,
        "driven_by": "calibrated odometry" if run.calibrated else "nominal odometry",
        "seconds": round(run.seconds, 3),
        "true_end": pose_in_words(true_end(run)),
        "closing_mm": {
            "x": round(1e3 * closing.x, 3),
            "y": round(1e3 * closing.y, 3),
            "distance": round(1e3 * closing.distance, 3),
        },
    }


def write_record(path: Path, runs: Sequence[SquareRun], nominal: WheelGeometry) -> None:
    """Keep the tracks of uncalibrated runs, so that `calibrate --measured` can use them; raises ConfigError."""
    document = {
        "nominal": {"wheel_base_mm": 1e3 * nominal.wheel_base, "counts_per_metre": nominal.counts_per_metre},
        "runs": [
            {
                "direction": run.direction,
                "side_m": run.side,
                "seconds": run.seconds,
                "track_counts": run.track,
            }
            for run in runs
        ],
    }
    replace_file(path, json.dumps(document) + "\n")


def read_record(path: Path) -> tuple[list[SquareRun], WheelGeometry]:
    """Read the runs of `labmate-drive square`; raises ConfigError."""
    try:
        document = json.loads(path.read_text(encoding="utf-8"))
        nominal = document["nominal"]
        geometry = WheelGeometry(
            float(nominal["wheel_base_mm"]) * 1e-3, 1.0, float(nominal["counts_per_metre"])
        )
        runs = [
            SquareRun(
                _direction(run["direction"]),
                False,
                float(run["side_m"]),
                float(run["seconds"]),
                tuple((int(left), int(right)) for left, right in run["track_counts"]),
                None,
            )
            for run in document["runs"]
        ]
    except OSError as error:
        raise ConfigError(str(path), "", None, f"cannot be read: {error.strerror}") from error
    except (ValueError, KeyError, TypeError) as error:
        raise ConfigError(str(path), "", None, f"is no record of `labmate-drive square` ({error})") from error
    return runs, geometry


def require_writable(directory: Path) -> None:
    """Make a directory that a run will write into, before anything has been driven; raises ConfigError."""
    try:
        directory.mkdir(parents=True, exist_ok=True)
        with TemporaryFile(dir=directory):
            pass
    except OSError as error:
        raise ConfigError(str(directory), "", None, f"cannot be written: {error.strerror}") from error


def _direction(name: str) -> Direction:
    for direction in DIRECTIONS:
        if name == direction:
            return direction
    raise ValueError(f"direction {name!r}")


def draw(path: Path, result: SquareResult) -> None:
    """The picture: true path, odometry and calibrated odometry of each way, and where the runs closed."""
    from matplotlib.figure import Figure

    found = result.calibration
    calibrated = found.geometry(result.nominal.counts_per_metre)
    figure = Figure(figsize=(14.4, 5.4), layout="constrained")
    axes = figure.subplots(1, 3)
    names = {"ccw": "Counter-clockwise", "cw": "Clockwise"}
    beside = {"ccw": (-34, 4), "cw": (7, 6)}
    for ax, run, again in zip(axes, result.uncalibrated, result.calibrated, strict=False):
        closing = 1e3 * result.closing(run).distance
        _plot(ax, run.true_path or (), _TRUE, "true path", linewidth=2.6)
        _plot(ax, run.path(calibrated), _CALIBRATED, "calibrated odometry", linestyle=":", linewidth=2.2)
        _plot(
            ax, again.true_path or (), _AGAIN, "true path, driven again calibrated", linewidth=2.6, alpha=0.6
        )
        _plot(ax, run.path(result.nominal), _ODOMETRY, "odometry", linestyle="--", linewidth=1.2)
        ax.plot(0.0, 0.0, marker="o", color=_TRUE, markersize=6, linestyle="none")
        ax.annotate("start", (0.0, 0.0), textcoords="offset points", xytext=beside[run.direction])
        ax.set_title(f"{names[run.direction]}: ends {closing:.0f} mm from where it believes")
        ax.set_xlabel("x (m)")
        ax.set_ylabel("y (m)")
        ax.set_aspect("equal")
        ax.margins(0.13)
        ax.grid(alpha=0.25)
    axes[0].legend(loc="center", fontsize=9)
    ends = axes[2]
    for runs, colour, label in (
        (result.uncalibrated, _ODOMETRY, "nominal odometry"),
        (result.calibrated, _CALIBRATED, "calibrated odometry"),
    ):
        for run in runs:
            closing_error = result.closing(run)
            marker = "o" if run.direction == "ccw" else "s"
            x, y = 1e3 * closing_error.x, 1e3 * closing_error.y
            distance = 1e3 * closing_error.distance
            text = f"{label}, {run.direction}: {distance:.{1 if distance >= 1.0 else 2}f} mm"
            ends.plot(x, y, marker=marker, color=colour, markersize=8, linestyle="none", label=text)
    ends.axhline(0.0, color="#888888", linewidth=0.8)
    ends.axvline(0.0, color="#888888", linewidth=0.8)
    ends.set_title(f"Wheel base {1e3 * found.wheel_base:.2f} mm, right/left {found.wheel_ratio:.5f}")
    ends.set_xlabel("true − odometry, x (mm)")
    ends.set_ylabel("true − odometry, y (mm)")
    ends.set_aspect("equal", adjustable="datalim")
    ends.margins(0.3)
    ends.legend(loc="best", fontsize=9)
    ends.grid(alpha=0.25)
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        # Nothing of the day goes into the file: two runs are alike to the byte.
        figure.savefig(path, dpi=120, metadata={"Software": None})
    except OSError as error:
        raise ConfigError(str(path), "", None, f"cannot be written: {error.strerror}") from error


def _plot(ax: Any, poses: Sequence[Pose], colour: str, label: str, **style: Any) -> None:
    ax.plot([p.x for p in poses], [p.y for p in poses], color=colour, label=label, **style)
