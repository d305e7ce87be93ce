"""The figures of the gaze experiments."""

from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from tools.gaze.rig import Run
from tools.gaze.single_axis import AxisTrack

TARGET, EYE, NECK, PREDICTIVE = "#222222", "#1e8449", "#1b4f72", "#b03a2e"
PID_SHADES = {
    "i": "#aeb6bf",
    "ii": "#85929e",
    "iii": "#5d6d7e",
    "iv": "#e59866",
    "v": "#ca6f1e",
    "vi": "#7fb3d5",
}


def _figure(title: str, rows: int, columns: int, **kwargs: Any) -> tuple[Figure, Any]:
    size = kwargs.pop("figsize", (11, 8))
    figure = Figure(figsize=size, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(title, fontsize=13, x=0.01, ha="left")
    axes = figure.subplots(rows, columns, squeeze=False, **kwargs)
    for each in axes.flat:
        each.grid(color="#e6e6e6", lw=0.6)
        each.set_axisbelow(True)
        each.spines[["top", "right"]].set_visible(False)
    return figure, axes


def _save(figure: Figure, path: Path) -> str:
    figure.savefig(path, dpi=130)
    return path.name


def draw_table_6_4(tracks: dict[str, AxisTrack], speed_deg_s: float, path: Path) -> str:
    """Figure 6.13: target and eye for the six settings."""
    title = f"Table 6.4 on a ramp of {speed_deg_s:g} °/s, sample period 1 ms, 1.5 Hz (figure 6.13)"
    figure, axes = _figure(title, 3, 2, sharex=True, sharey=True)
    for column, names in enumerate((("i", "ii", "iii"), ("iv", "v", "vi"))):
        for row, name in enumerate(names):
            track, each = tracks[name], axes[row, column]
            each.plot(track.times, track.target, color=TARGET, lw=1.1, label="target")
            each.step(track.times, track.eye, color=EYE, lw=1.3, where="post", label="left eye")
            each.set_title(f"({name})  RMS {track.rms:.2f}°", loc="left", fontsize=10)
    for each in axes[:, 0]:
        each.set_ylabel("angle [°]")
    for each in axes[-1]:
        each.set_xlabel("time [s]")
    axes[0, 0].legend(frameon=False, loc="upper left")
    return _save(figure, path)


def draw_figure_6_14(tracks: dict[str, dict[str, AxisTrack]], path: Path) -> str:
    """Figure 6.14: error of setting iv at two sample periods and with microsaccades."""
    figure, axes = _figure(
        "Setting iv on slow targets of ±15°: the least speed of one count a sample (figure 6.14)",
        3, 2, sharex=True, sharey=True,
    )  # fmt: skip
    for column, wave in enumerate(("sine", "triangle")):
        for row, (label, track) in enumerate(tracks[wave].items()):
            each = axes[row, column]
            each.axhline(0.0, color="#999999", lw=0.8)
            each.step(track.times, track.target - track.eye, color=EYE, lw=1.2, where="post")
            each.set_title(f"{wave}, {label}: RMS {track.rms:.2f}°", loc="left", fontsize=10)
    for each in axes[:, 0]:
        each.set_ylabel("error [°]")
    for each in axes[-1]:
        each.set_xlabel("time [s]")
    return _save(figure, path)


def draw_sweep(rows: list[dict[str, Any]], controllers: list[str], path: Path) -> str:
    """RMS error against peak speed, a column a frame rate; lost runs as crosses at the top."""
    rates = sorted({row["rate_hz"] for row in rows})
    figure, axes = _figure(
        "PID (table 6.4) against predictive pursuit: ±25°, camera latency 60 ms", 2, len(rates),
        sharex=True, sharey=True, figsize=(12, 7.5),
    )  # fmt: skip
    for line, wave in enumerate(("sine", "triangle")):
        for column, rate in enumerate(rates):
            each = axes[line, column]
            chosen = [r for r in rows if (r["wave"], r["rate_hz"], r["amplitude_deg"]) == (wave, rate, 25.0)]
            chosen.sort(key=lambda r: r["speed_deg_s"])
            for name in controllers:
                colour = PREDICTIVE if name == "predictive" else PID_SHADES[name]
                kept = [r for r in chosen if not r[name]["lost"]]
                lost = [r for r in chosen if r[name]["lost"]]
                each.plot(
                    [r["speed_deg_s"] for r in kept], [r[name]["rms_deg"] for r in kept], "o-", color=colour,
                    ms=3.5, lw=2.0 if name == "predictive" else 1.0,
                    label=name if name == "predictive" else f"PID {name}",
                )  # fmt: skip
                if lost:
                    each.plot([r["speed_deg_s"] for r in lost], [60.0] * len(lost), "x", color=colour, ms=6)
            limit = 8.0 * rate
            if chosen and limit < 60.0:
                each.axvspan(limit, 75.0, color="#f2f3f4", lw=0)
                each.text(
                    limit * 1.04, 0.025, "not compared", fontsize=8, color="#777777", va="bottom", rotation=90
                )
            each.set(xscale="log", yscale="log", xlim=(0.8, 75.0), ylim=(0.02, 80.0))
            each.set_xticks([1, 2, 5, 10, 20, 50], labels=["1", "2", "5", "10", "20", "50"])
            each.set_yticks(
                [0.03, 0.1, 0.3, 1, 3, 10, 30], labels=["0.03", "0.1", "0.3", "1", "3", "10", "30"]
            )
            each.minorticks_off()
            each.set_title(f"{wave}, {rate:g} Hz", loc="left", fontsize=10)
            if line:
                each.set_xlabel("peak speed [°/s]")
        axes[line, 0].set_ylabel("true RMS error [°] (x: lost)")
    axes[0, 0].legend(frameon=False, fontsize=8, loc="upper left", ncols=2)
    return _save(figure, path)


def draw_coordination(runs: dict[str, Run], figures: dict[str, Any], path: Path) -> str:
    """Neck and eyes for the three ways of 6.5.3."""
    figure, axes = _figure("Coordination (i), (ii), (iii) on one path, 6 Hz", 3, 1, sharex=True, sharey=True)
    names = {
        "i": "eyes first, fast neck",
        "ii": "neck follows, eyes symmetric",
        "iii": "shared by effort and comfort",
    }
    for row, (name, run) in enumerate(runs.items()):
        each = axes[row, 0]
        each.plot(run.times, np.degrees(run.target_azimuth()), color=TARGET, lw=1.0, label="target")
        each.plot(run.times, np.degrees([q.pan for q in run.joints]), color=NECK, lw=1.4, label="pan")
        each.plot(run.times, np.degrees([q.version for q in run.joints]), color=EYE, lw=1.4, label="version")
        each.set_ylabel("angle [°]")
        each.set_title(
            f"({name}) {names[name]}: RMS {figures[name]['rms_deg']:.2f}°, {figures[name]['saccades']} saccades",
            loc="left", fontsize=10,
        )  # fmt: skip
    axes[0, 0].legend(frameon=False, loc="lower right", bbox_to_anchor=(1.0, 1.0), ncols=3, borderaxespad=0.0)
    axes[-1, 0].set_xlabel("time [s]")
    return _save(figure, path)


def draw_vergence(run: Run, path: Path) -> str:
    """Distance, vergence angle and its true error."""
    figure, axes = _figure("Vergence on a target between 0.3 and 3 m, 6 Hz", 3, 1, sharex=True)
    axes[0, 0].plot(run.times, np.linalg.norm(run.target, axis=1), color=TARGET, lw=1.2)
    axes[0, 0].set_ylabel("distance [m]")
    axes[1, 0].plot(run.times, np.degrees([q.vergence for q in run.joints]), color=EYE, lw=1.4)
    axes[1, 0].set_ylabel("vergence [°]")
    axes[2, 0].axhline(0.0, color="#999999", lw=0.8)
    axes[2, 0].plot(run.times, np.degrees(run.vergence_errors()), color=PREDICTIVE, lw=1.2)
    axes[2, 0].set_ylabel("vergence error [°]")
    axes[-1, 0].set_xlabel("time [s]")
    return _save(figure, path)


def draw_screen(run: Run, share: float, path: Path) -> str:
    """True joints before the swinging screen of real pictures, and the retinal error at the sightings."""
    figure, axes = _figure(
        f"Real pictures on a swinging screen: in both foveas in {100 * share:.1f} % of the pictures", 2, 1,
        sharex=True, figsize=(11, 6),
    )  # fmt: skip
    stamps = [row.stamp - run.start for row in run.log.rows]
    error = np.degrees([run.log.retinal_error(row) for row in run.log.rows])
    axes[0, 0].plot(stamps, error, color=PREDICTIVE, lw=1.2)
    axes[0, 0].set(ylabel="disc from the\nworse optical axis [°]", ylim=(0, None))
    for values, colour, label in (
        (run.target_azimuth(), TARGET, "middle of the screen"),
        (np.array([q.pan for q in run.joints]), NECK, "pan"),
        (run.gaze_azimuth(), EYE, "pan + version"),
    ):
        axes[1, 0].plot(run.times, np.degrees(values), color=colour, lw=1.2, label=label)
    axes[1, 0].set(ylabel="azimuth [°]", xlabel="time [s]")
    axes[1, 0].legend(frameon=False, loc="upper right", ncols=3)
    return _save(figure, path)
