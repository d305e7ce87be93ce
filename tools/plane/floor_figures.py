"""The figures of the floor experiment."""

from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle

from perception.plane.direct import estimate_plane_motion
from perception.plane.heights import HeightMap, measure_heights
from perception.plane.obstacles import LIMIT, find_obstacles
from perception.plane.parallax import Parallax
from perception.plane.template import Template
from tools.plane.floor_scores import FloorScore, roc, watched
from tools.plane.floors import BOX_M, CAMERA, FloorCase, drive
from tools.plane.style import COLOURS, INK, SOFT, STYLE, save


def _bare(axes: Axes, title: str) -> None:
    axes.set_title(title)
    axes.set_xticks([])
    axes.set_yticks([])
    for side in axes.spines.values():
        side.set_visible(False)


def strongest(heights: HeightMap) -> tuple[Any, Any]:
    """Height and score of the cell that answers most strongly at each place."""
    score = np.nan_to_num(heights.score)
    best = np.abs(score).argmax(axis=0)[None]
    return np.take_along_axis(heights.height, best, 0)[0], np.take_along_axis(score, best, 0)[0]


def draw_heights(path: Path, cases: dict[str, FloorCase]) -> None:
    """Both images, the scores and the heights that are beyond the limit, one column a case."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(3, len(cases), figsize=(2.7 * len(cases), 8.2), layout="constrained")
        for column, (title, case) in enumerate(cases.items()):
            pair = drive(case)
            template = Template(pair.first, watched())
            seen = estimate_plane_motion(template, pair.second, pair.floor.homography(CAMERA, pair.motion))
            assert seen is not None
            parallax = Parallax.of(watched(), CAMERA, pair.motion, pair.floor.q)
            heights = measure_heights(template, pair.second, seen, parallax)
            height, score = strongest(heights)
            image, scores, shown = grid[:, column]
            _bare(image, title)
            image.imshow(pair.first, cmap="gray", vmin=0, vmax=255)
            image.contour(pair.obstacle.astype(float), [0.5], colors=COLOURS[2], linewidths=0.9)
            extent = (
                float(heights.x_px[0, 0]) - 2,
                float(heights.x_px[0, -1]) + 2,
                float(heights.y_px[-1, 0]) + 2,
                float(heights.y_px[0, 0]) - 2,
            )
            _bare(scores, f"strongest {np.abs(score).max():.1f} deviations")
            colours = scores.imshow(score, extent=extent, cmap="RdBu_r", vmin=-12, vmax=12)
            obstacles = find_obstacles(heights)
            text = f"h/H = {obstacles[0].height:.3f} ± {obstacles[0].std:.3f}" if obstacles else "nothing"
            _bare(shown, text)
            shown.imshow(pair.first, cmap="gray", vmin=0, vmax=255, alpha=0.55)
            beyond = np.where(np.abs(score) >= LIMIT, height, np.nan)
            tall = shown.imshow(beyond, extent=extent, cmap="viridis", vmin=0, vmax=0.05, alpha=0.85)
            for axes in (scores, shown):
                axes.set(xlim=image.get_xlim(), ylim=image.get_ylim())
            for obstacle in obstacles[:1]:
                left, top, right, bottom = obstacle.box_px
                shown.add_patch(
                    Rectangle((left, top), right - left, bottom - top, fill=False, color=COLOURS[2])
                )
        figure.colorbar(colours, ax=grid[1, :], label="k in its deviations", shrink=0.9)
        figure.colorbar(tall, ax=grid[2, :], label="h/H", shrink=0.9)
        save(figure, path)


def draw_roc(path: Path, panels: dict[str, tuple[list[FloorScore], list[FloorScore]]]) -> None:
    """Boxes found over empty images that alarm, one panel a case."""
    with plt.rc_context(STYLE):
        figure, grid = plt.subplots(
            1, len(panels), figsize=(3.1 * len(panels), 3.6), layout="constrained", sharey=True
        )
        for axes, (title, (empty, boxes)) in zip(np.atleast_1d(grid), panels.items(), strict=True):
            for name, colour in zip(boxes[0].strengths, COLOURS, strict=False):
                alarms, found = roc(empty, boxes, name)
                wide = {"lw": 2.2, "zorder": 3} if colour == COLOURS[0] else {"lw": 1.3}
                axes.step(100 * alarms, 100 * found, where="post", color=colour, label=name, **wide)
            axes.axhline(95, color=SOFT, lw=0.8, ls=":")
            axes.set(xlim=(-1.5, 101), ylim=(-1.5, 103), title=title, xlabel="empty images that alarm, %")
        np.atleast_1d(grid)[0].set_ylabel("boxes found, %")
        handles, labels = np.atleast_1d(grid)[0].get_legend_handles_labels()
        figure.legend(handles, labels, fontsize=8, loc="outside lower center", ncols=4)
        save(figure, path)


def draw_least(path: Path, tables: dict[str, tuple[float, dict[str, Any]]]) -> None:
    """Boxes found with no alarm in the empty images over the boxes' height, one line a floor and step."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(6.6, 4.0), layout="constrained")
        for (name, (_, table)), colour in zip(tables.items(), COLOURS, strict=False):
            found = next(iter(table.values()))["found_percent"]
            heights = sorted(float(height) for height in found)
            axes.plot(
                heights, [found[f"{height:g}"] for height in heights], "o-", ms=4, color=colour, label=name
            )
        axes.axhline(95, color=INK, lw=0.8, ls=":")
        axes.text(axes.get_xlim()[0], 95.5, " 95 %", fontsize=7.5)
        axes.set(
            xscale="log", xlabel="height of the box over that of the camera, h/H", ylabel="boxes found, %"
        )
        axes.set(ylim=(0, 103), title=f"Box of {100 * BOX_M:.0f} cm, no alarm in any empty image")
        axes.set_xticks(
            [0.002, 0.005, 0.01, 0.02, 0.05, 0.1, 0.2], [".002", ".005", ".01", ".02", ".05", ".1", ".2"]
        )
        axes.minorticks_off()
        axes.legend(fontsize=8, loc="lower right")
        save(figure, path)


def draw_real(path: Path, rows: list[tuple[str, Any, Any, float, Any]]) -> None:
    """Real images with what departs from their plane; (title, image, map, limit px, box)."""
    with plt.rc_context(STYLE):
        columns = 3
        lines = -(-len(rows) // columns)
        figure, grid = plt.subplots(
            lines, columns, figsize=(3.9 * columns, 3.0 * lines), layout="constrained", squeeze=False
        )
        shown = None
        for axes, (title, image, departure, limit, box) in zip(grid.ravel(), rows, strict=False):
            _bare(axes, title)
            axes.imshow(image, cmap="gray", vmin=0, vmax=255)
            beyond = np.where(departure.departure_px >= limit, departure.departure_px, np.nan)
            extent = (
                float(departure.x_px[0, 0]) - 2,
                float(departure.x_px[0, -1]) + 2,
                float(departure.y_px[-1, 0]) + 2,
                float(departure.y_px[0, 0]) - 2,
            )
            shown = axes.imshow(beyond, extent=extent, cmap="autumn_r", vmin=limit, vmax=1.5, alpha=0.55)
            axes.set(xlim=(-0.5, image.shape[1] - 0.5), ylim=(image.shape[0] - 0.5, -0.5))
            if box is not None:
                left, top, right, bottom = box
                axes.add_patch(
                    Rectangle((left, top), right - left, bottom - top, fill=False, color=COLOURS[0], lw=1.5)
                )
        for axes in grid.ravel()[len(rows) :]:
            axes.set_visible(False)
        if shown is not None:
            figure.colorbar(
                shown, ax=grid, label="moves otherwise than the plane, px", shrink=0.6, extend="max"
            )
        save(figure, path)
