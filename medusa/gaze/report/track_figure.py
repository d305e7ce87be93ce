"""The picture that a tracking run leaves behind: errors at the retinas, and how neck and eyes shared the turn."""

import math
from pathlib import Path
from typing import Any

from medusa.gaze.report.track_log import TrackLog

LEFT, RIGHT, PAN, TILT, SUM = "#1e8449", "#943126", "#1b4f72", "#b9770e", "#222222"


def draw_track(log: TrackLog, path: Path, *, start: float) -> None:
    """Write the picture; times count from `start` on the loop's clock. Raises OSError."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("Gaze: target against optical axes, and the joints", fontsize=13, x=0.01, ha="left")
    axes: Any = figure.subplots(3, 1, sharex=True, height_ratios=(3, 2, 3))
    times = [row.stamp - start for row in log.rows]
    for index, label in ((0, "across"), (1, "down")):
        for eye, colour in (("left", LEFT), ("right", RIGHT)):
            values = [_degrees(getattr(row, eye), index) for row in log.rows]
            style = "-" if index == 0 else (0, (2, 1.5))
            axes[0].plot(times, values, color=colour, ls=style, lw=1.3, label=f"{eye}, {label}")
    axes[0].set_ylabel("target from\noptical axis [°]")
    vergence = [
        math.nan if row.left is None or row.right is None else _degrees(row.left, 0) - _degrees(row.right, 0)
        for row in log.rows
    ]
    axes[1].plot(times, vergence, color=SUM, lw=1.3)
    axes[1].set_ylabel("vergence error [°]")
    for values, colour, label in (
        ([row.joints.pan for row in log.rows], PAN, "pan"),
        ([row.joints.tilt for row in log.rows], TILT, "tilt"),
        ([row.joints.version for row in log.rows], LEFT, "version"),
        ([row.joints.vergence for row in log.rows], RIGHT, "vergence"),
        ([row.joints.pan + row.joints.version for row in log.rows], SUM, "pan + version"),
    ):
        axes[2].plot(times, [math.degrees(v) for v in values], color=colour, lw=1.3, label=label)
    axes[2].set_ylabel("joints [°]")
    axes[2].set_xlabel("time since the gaze began [s]")
    for which, columns in ((axes[0], 4), (axes[2], 5)):
        which.legend(
            ncols=columns, loc="lower right", bbox_to_anchor=(1.0, 1.0), frameon=False, borderaxespad=0.0
        )
    for each in axes:
        for begin, end, _ in log.saccades:
            each.axvspan(begin - start, end - start, color="#d6dbdf", lw=0)
        each.axhline(0.0, color="#999999", lw=0.6)
        each.grid(axis="y", color="#e3e3e3", lw=0.6)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    axes[1].annotate(
        "grey: saccades",
        (1.0, 0.97),
        xycoords="axes fraction",
        ha="right",
        va="top",
        fontsize=8,
        color="#666666",
    )
    figure.savefig(path, dpi=130)


def _degrees(tangents: tuple[float, float] | None, index: int) -> float:
    return math.nan if tangents is None else math.degrees(math.atan(tangents[index]))
