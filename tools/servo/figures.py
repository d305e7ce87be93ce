"""Figures of the runs on the emulated head: measured, predicted, and the same with friction and backlash."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any

import numpy as np

from medusa.servo.figures import BLUE, GREEN, GREY, INK, RED, new_figure, styled
from medusa.servo.thesis import AXES

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from tools.servo.runs import Run
    from tools.servo.saccades import SaccadeRun

ROUGH = "2 DAC counts of friction, 0.02° of play"


def _title(axis: str) -> str:
    return axis.replace("_", " ")


def _every(run: Run, until_ms: float) -> int:
    """Which samples are dotted: about thirty in the time shown, so that the line stays to be seen."""
    return max(1, round(until_ms / (1e3 * run.period) / 30))


def _degrees(run: Run) -> float:
    return AXES[run.axis].counts_per_degree


def _shared_legend(figure: Figure, axes: Any, columns: int = 4) -> None:
    handles, labels = axes.get_legend_handles_labels()
    figure.legend(handles, labels, loc="outside lower center", ncols=columns, fontsize=9)


@styled
def figure_steps(smooth: Mapping[str, Sequence[Run]], rough: Mapping[str, Sequence[Run]]) -> Figure:
    """Position steps of every joint: rows by size, the shaft against its prediction."""
    names = list(smooth)
    sizes = len(next(iter(smooth.values())))
    figure, grid = new_figure(3.1 * len(names), 2.5 * sizes, nrows=sizes, ncols=len(names), squeeze=False)
    for column, name in enumerate(names):
        for row in range(sizes):
            ax, run, other = grid[row, column], smooth[name][row], rough[name][row]
            step = abs(float(run.command[-1]))
            sign = math.copysign(1.0, run.command[-1])
            span = 1.5 * max(run.step().settling, 0.03) * 1e3
            ax.axhline(step, color=GREY, linewidth=0.8)
            ax.plot(other.time * 1e3, sign * other.shaft, color=RED, linewidth=1.1, label=f"with {ROUGH}")
            ax.plot(
                run.time * 1e3, sign * run.shaft, color=BLUE, linewidth=1.8, label="emulated board and motor"
            )
            ax.plot(
                run.time * 1e3,
                sign * run.predicted,
                ".",
                color=INK,
                markersize=4,
                markevery=_every(run, span),
                label="design's prediction",
            )
            ax.set_xlim(0, span)
            ax.set_ylim(-0.03 * step, 1.1 * step)
            if row == 0:
                ax.set_title(_title(name))
            if row == sizes - 1:
                ax.set_xlabel("time (ms)")
            if column == 0:
                ax.set_ylabel(f"{step:.0f}-count step\n(counts)")
    _shared_legend(figure, grid[0, 0])
    return figure


def _speed(run: Run, positions: Any) -> Any:
    return np.gradient(positions, run.period) / _degrees(run)


@styled
def figure_velocities(
    rows: Sequence[tuple[str, Mapping[str, Run], Mapping[str, Run]]],
) -> Figure:
    """Velocity steps: a row for each (label, frictionless, rough); speeds are of the shaft over one sample."""
    names = list(rows[0][1])
    figure, grid = new_figure(
        3.1 * len(names), 2.6 * len(rows), nrows=len(rows), ncols=len(names), squeeze=False
    )
    for row, (label, smooth, rough) in enumerate(rows):
        for column, name in enumerate(names):
            ax, run, other = grid[row, column], smooth[name], rough[name]
            sign = math.copysign(1.0, run.command[-1])
            until = 80.0 if row == 0 else 160.0
            ax.plot(
                run.time * 1e3, sign * _speed(run, run.command), color=GREY, linewidth=1.2, label="commanded"
            )
            ax.plot(
                other.time * 1e3,
                sign * _speed(other, other.shaft),
                color=RED,
                linewidth=0.9,
                label=f"with {ROUGH}",
            )
            ax.plot(
                run.time * 1e3, sign * _speed(run, run.shaft), color=BLUE, linewidth=1.5, label="emulated"
            )
            ax.plot(
                run.time * 1e3,
                sign * _speed(run, run.predicted),
                ".",
                color=INK,
                markersize=4,
                markevery=_every(run, until),
                label="predicted",
            )
            ax.set_xlim(0, until)
            ax.set_ylim(bottom=-1)
            if row == 0:
                ax.set_title(_title(name))
            if row == len(rows) - 1:
                ax.set_xlabel("time (ms)")
            if column == 0:
                ax.set_ylabel(f"{label}\nspeed (°/s)")
    _shared_legend(figure, grid[0, 0])
    return figure


@styled
def figure_profiles(smooth: Mapping[str, Run], rough: Mapping[str, Run]) -> Figure:
    """30° profiles: speed, following error and motor command of every joint."""
    names = list(smooth)
    figure, grid = new_figure(3.1 * len(names), 6.6, nrows=3, ncols=len(names), sharex="col", squeeze=False)
    traces: list[tuple[str, Callable[[Run], Any]]] = [
        ("speed (°/s)", lambda run: _speed(run, run.shaft)),
        ("following error (°)", lambda run: (run.command - run.counts) / _degrees(run)),
        ("motor command\n(DAC counts)", lambda run: run.dac),
    ]
    for column, name in enumerate(names):
        run, other = smooth[name], rough[name]
        sign = math.copysign(1.0, run.command[-1])
        until = 1.25e3 * float(run.time[np.argmax(run.command == run.command[-1])])
        for row, (label, trace) in enumerate(traces):
            ax = grid[row, column]
            if row == 0:
                ax.plot(
                    run.time * 1e3,
                    sign * _speed(run, run.command),
                    color=GREY,
                    linewidth=1.2,
                    label="commanded",
                )
                ax.plot(
                    run.time * 1e3,
                    sign * _speed(run, run.predicted),
                    ".",
                    color=INK,
                    markersize=4,
                    markevery=_every(run, until),
                    zorder=3,
                    label="predicted",
                )
                ax.set_title(_title(name))
            ax.plot(other.time * 1e3, sign * trace(other), color=RED, linewidth=0.9, label=f"with {ROUGH}")
            ax.plot(run.time * 1e3, sign * trace(run), color=BLUE, linewidth=1.4, label="emulated")
            if column == 0:
                ax.set_ylabel(label)
            if row == 2:
                ax.set_xlabel("time (ms)")
                ax.axhline(127, color=GREY, linewidth=0.8, linestyle=":")
                ax.set_ylim(-15, 135)
                ax.set_xlim(0, until)
    _shared_legend(figure, grid[0, 0])
    return figure


@styled
def figure_search(thesis: Mapping[str, Sequence[Run]], searched: Mapping[str, Sequence[Run]]) -> Figure:
    """The thesis's bytes and the searched ones on the emulated plant, steps of 100 and 1000 counts."""
    names = list(thesis)
    figure, grid = new_figure(3.6 * len(names), 5.2, nrows=2, ncols=len(names), squeeze=False)
    for column, name in enumerate(names):
        for row in range(2):
            ax = grid[row, column]
            step = abs(float(thesis[name][row].command[-1]))
            ax.axhspan(0.98 * step, 1.02 * step, color="#eef3f8", linewidth=0)
            for runs, colour, label in (
                (thesis, GREY, "thesis's bytes"),
                (searched, GREEN, "searched bytes"),
            ):
                run = runs[name][row]
                ax.plot(run.time * 1e3, np.abs(run.shaft), color=colour, linewidth=1.8, label=label)
            ax.set_xlim(0, 60 if row == 0 else 100)
            ax.set_ylim(0, 1.12 * step)
            if row == 0:
                ax.set_title(_title(name))
            else:
                ax.set_xlabel("time (ms)")
            if column == 0:
                ax.set_ylabel(f"{step:.0f}-count step\n(counts)")
    _shared_legend(figure, grid[0, 0])
    return figure


@styled
def figure_saccade(run: SaccadeRun) -> Figure:
    """A four-joint saccade: commanded and true joint angles, and the last samples of the commands."""
    figure, (left, right) = new_figure(9.6, 3.8, ncols=2, width_ratios=(2, 1))
    colours = dict(zip(run.time, (INK, BLUE, GREEN, RED), strict=False))
    for name, colour in colours.items():
        time = (run.time[name] - run.start) * 1e3
        left.plot(time, run.angle_deg[name], color=colour, linewidth=1.8, label=_title(name))
        left.plot(time, run.command_deg[name], color=colour, linewidth=0.9, linestyle=":")
        to_go = np.abs(run.command_deg[name] - run.command_deg[name][-1])
        right.step(time, to_go, where="post", color=colour, linewidth=1.4)
    end = (run.end - run.start) * 1e3
    left.set_xlim(0, end + 60)
    left.set_xlabel("time after START (ms)")
    left.set_ylabel("joint angle (°)")
    left.set_title("Four joints that arrive together")
    left.plot([], [], color=GREY, linewidth=0.9, linestyle=":", label="command")
    left.legend(fontsize=8.5)
    right.set_xlim(end - 22, end + 6)
    right.set_ylim(0, 0.25)
    right.set_xlabel("time after START (ms)")
    right.set_ylabel("command still to go (°)")
    right.set_title("the last samples")
    return figure
