"""The figures of the depth experiment."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from perception.depth import DepthMap
from tools.depth.scenes import Sequence

INK, SOFT = "#22303c", "#c9d2d9"
COLOURS = {
    "default": "#0b6e8a",
    "thesis": "#c8651b",
    "thesis-unequalised": "#8a2b5b",
    "StereoSGBM 3-way": "#6b7a86",
    "StereoBM": "#b3bec7",
}
NAMES = {"default": "default", "thesis": "thesis", "thesis-unequalised": "thesis, unequalised"}
STYLE: Any = {
    "font.size": 9.0,
    "axes.edgecolor": INK,
    "axes.labelcolor": INK,
    "axes.titlesize": 9.5,
    "axes.titlecolor": INK,
    "text.color": INK,
    "xtick.color": INK,
    "ytick.color": INK,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "legend.frameon": False,
    "figure.dpi": 130.0,
    "savefig.bbox": "tight",
}


def _save(figure: Figure, path: Path) -> None:
    figure.savefig(path)
    plt.close(figure)


def _picture(axes: Axes, image: np.ndarray[Any, Any], title: str, **colours: Any) -> Any:
    axes.set_title(title)
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)
    return axes.imshow(image, **colours)


def draw_scene(
    path: Path, title: str, sequence: Sequence, maps: dict[str, list[DepthMap]], near: float, far: float
) -> None:
    """First and last picture and the truth above; below, the last depth of each preset, one colour scale."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(2, 4, figsize=(11.0, 4.9), layout="constrained")
        figure.suptitle(title, fontsize=11)
        bright = float(np.percentile(sequence.images[0], 99.5))
        _picture(grid[0, 0], sequence.images[0], "first picture", cmap="gray", vmin=0, vmax=bright)
        _picture(
            grid[0, 1],
            sequence.images[-1],
            f"picture {len(sequence.images)}",
            cmap="gray",
            vmin=0,
            vmax=bright,
        )
        scale: dict[str, Any] = {"cmap": "turbo_r", "vmin": near, "vmax": far}
        shown = _picture(grid[0, 2], 1 / sequence.truth[-1], "true depth", **scale)
        default = maps["default"][-1]
        with np.errstate(invalid="ignore", divide="ignore"):
            part = 100 * default.depth_std / default.depth
            error = 100 * np.abs(default.state.value / sequence.truth[-1] - 1)
        spread = _picture(
            grid[0, 3],
            part,
            "stated deviation, default",
            cmap="magma",
            vmin=0,
            vmax=float(np.percentile(part, 97)),
        )
        figure.colorbar(spread, ax=grid[0, 3], label="% of depth", shrink=0.9)
        for axes, preset in zip(grid[1], maps, strict=False):
            found = maps[preset][-1]
            worst = float(np.nanmedian(100 * np.abs(found.state.value / sequence.truth[-1] - 1)))
            _picture(axes, found.depth, f"{NAMES[preset]}: error {worst:.2g} %", **scale)
        figure.colorbar(shown, ax=grid[:, 2], label="depth, m", shrink=0.9)
        wrong = _picture(
            grid[1, 3], error, "error, default", cmap="magma", vmin=0, vmax=float(np.percentile(part, 97))
        )
        figure.colorbar(wrong, ax=grid[1, 3], label="% of depth", shrink=0.9)
        _save(figure, path)


def draw_frames(path: Path, runs: dict[str, list[dict[str, float]]], turn: dict[str, Any]) -> None:
    """Error and stated deviation frame by frame, and the horizontal edges when the motion turns."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(1, 2, figsize=(10.5, 3.7), layout="constrained")
        palette = ["#0b6e8a", "#c8651b", "#5a8f29", "#8a2b5b", "#22303c"]
        for (name, scores), colour in zip(runs.items(), palette, strict=False):
            pairs = np.arange(1, len(scores) + 1)
            left.plot(
                pairs, [100 * s["median_error"] for s in scores], "o-", ms=3.5, color=colour, label=name
            )
            left.plot(pairs, [100 * s["stated"] for s in scores], "--", lw=1, color=colour)
        left.plot([], [], "--", lw=1, color=INK, label="stated deviation (median)")
        left.set(
            title="Median error and stated deviation",
            xlabel="pair of pictures",
            ylabel="% of depth",
            yscale="log",
        )
        left.yaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
        left.yaxis.set_major_formatter(FormatStrFormatter("%g"))
        left.yaxis.set_minor_formatter(NullFormatter())
        left.legend(fontsize=8, loc="upper right", ncols=2)
        left.set_ylim(top=2.2)
        lines = {
            "right then up, horizontal edges": ("#c8651b", "-"),
            "right only, horizontal edges": ("#c8651b", ":"),
            "right then up, vertical edges": ("#0b6e8a", "-"),
        }
        for name, (colour, style) in lines.items():
            values = [100 * s["mean_error"] for s in turn[name]]
            right.plot(
                np.arange(1, len(values) + 1), values, style, marker="o", ms=3.5, color=colour, label=name
            )
        right.axvline(turn["turns_after"] + 0.5, color=SOFT, lw=6, zorder=0)
        right.text(turn["turns_after"] + 0.62, right.get_ylim()[1], "motion turns up", va="top", fontsize=8)
        right.set(
            title="Edges along the motion, until it turns",
            xlabel="pair of pictures",
            ylabel="mean error, % of depth",
        )
        right.set_ylim(bottom=0)
        right.legend(fontsize=8)
        _save(figure, path)


def draw_light(path: Path, tables: dict[str, dict[str, dict[str, float]]]) -> None:
    """Bad pixels by light and preset, one panel a scene."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(
            1, len(tables), figsize=(5 * len(tables) + 0.8, 3.5), layout="constrained", squeeze=False
        )
        for axes, (scene, table) in zip(panels[0], tables.items(), strict=True):
            lights = list(next(iter(table.values())))
            width = 0.8 / len(table)
            for k, (name, values) in enumerate(table.items()):
                place = np.arange(len(lights)) + (k - (len(table) - 1) / 2) * width
                bars = axes.bar(
                    place,
                    [values[light] for light in lights],
                    0.92 * width,
                    color=COLOURS[name],
                    label=NAMES.get(name, name),
                )
                if len(table) < 4:
                    axes.bar_label(bars, fmt="%.1f", fontsize=7, padding=1)
            axes.set_xticks(np.arange(len(lights)), lights, fontsize=8)
            axes.set(title=scene, ylabel="pixels wrong by more than 2 px, %")
        panels[0, -1].legend(fontsize=8, loc="upper left", bbox_to_anchor=(1.01, 1.0))
        _save(figure, path)


def draw_coverage(path: Path, covers: dict[str, tuple[float, float]]) -> None:
    """How many errors lie within the 68 % and the 95 % interval, rendered and real, beside what is required."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(7.2, 0.42 * len(covers) + 1.4), layout="constrained")
        rows = np.arange(len(covers))[::-1]
        axes.axvspan(60, 76, color="#0b6e8a", alpha=0.13, lw=0)
        axes.axvspan(91, 98, color="#c8651b", alpha=0.13, lw=0)
        for index, colour, label in (
            (0, "#0b6e8a", "within 1 σ (68 %)"),
            (1, "#c8651b", "within 1.96 σ (95 %)"),
        ):
            axes.plot([pair[index] for pair in covers.values()], rows, "o", color=colour, label=label)
        axes.set_yticks(rows, list(covers))
        axes.set(
            xlabel="errors within the stated interval, %",
            xlim=(0, 100),
            title="Are the stated deviations honest?",
        )
        axes.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), fontsize=8)
        axes.grid(axis="y", color=SOFT, lw=0.5)
        _save(figure, path)
