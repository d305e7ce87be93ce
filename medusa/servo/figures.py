"""Figures 6.5–6.7: root loci without and with the filter, and the step response it was designed for."""

from __future__ import annotations

import functools
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, Any, ParamSpec, TypeVar

import numpy as np
from numpy.typing import NDArray

from medusa.servo.loop import simulate_linear, simulate_position
from medusa.servo.plant import DiscretePlant
from medusa.servo.position_filter import (
    Filter,
    closed_loop_poles,
    compensated_gain_limit,
    double_pole_gains,
    uncompensated_breakaway,
    uncompensated_gain_limit,
)

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from medusa.servo.design import ServoDesign

INK, BLUE, RED, GREEN, GREY = "#1b1f24", "#1f6fb2", "#c8452f", "#2f8f5b", "#8a9099"
STYLE: dict[Any, Any] = {
    "font.size": 9.5,
    "axes.edgecolor": GREY,
    "axes.linewidth": 0.8,
    "axes.spines.top": False,
    "axes.spines.right": False,
    "axes.grid": True,
    "grid.color": "#e6e8eb",
    "grid.linewidth": 0.7,
    "axes.axisbelow": True,
    "axes.titlesize": 10.5,
    "axes.titleweight": "bold",
    "axes.titlelocation": "left",
    "legend.frameon": False,
    "xtick.color": INK,
    "ytick.color": INK,
    "figure.dpi": 130,
    "savefig.bbox": "tight",
}


P = ParamSpec("P")
R = TypeVar("R")


def styled(draw: Callable[P, R]) -> Callable[P, R]:
    """Run a drawing function in the project's style, whatever the surrounding matplotlib settings."""

    @functools.wraps(draw)
    def inside(*args: P.args, **kwargs: P.kwargs) -> R:
        import matplotlib

        with matplotlib.rc_context(STYLE):
            return draw(*args, **kwargs)

    return inside


@styled
def new_figure(width: float, height: float, **subplots: Any) -> tuple[Figure, Any]:
    """A figure with one axes, or those of `subplots`; it needs no display."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(width, height), layout="constrained")
    FigureCanvasAgg(figure)
    return figure, figure.subplots(**subplots)


@styled
def save_figure(figure: Figure, path: Path) -> None:
    """Write a PNG, its directory made where it is missing."""
    path.parent.mkdir(parents=True, exist_ok=True)
    figure.savefig(path)


def draw_root_locus(axes: Axes, plant: DiscretePlant, controller: Filter, gains: NDArray[np.float64]) -> None:
    """The closed-loop poles of K (z − A)/(z + B) P(z) for rising K; `controller`'s own gain is not used."""
    import control

    shape = plant.position()
    if (controller.zero, controller.pole) != (0.0, 0.0):
        shape = Filter(controller.zero, controller.pole, 1.0).transfer_function(plant.period) * shape
    locus = control.root_locus_map(shape, gains=gains).loci
    axes.add_patch(_unit_circle())
    axes.axhline(0, color=GREY, linewidth=0.6)
    for branch in locus.T:
        axes.plot(branch.real, branch.imag, color=BLUE, linewidth=1.6)
    poles, zeros = shape.poles(), shape.zeros()
    axes.plot(
        poles.real, poles.imag, "x", color=RED, markersize=8, markeredgewidth=1.8, label="open-loop poles"
    )
    axes.plot(
        zeros.real, zeros.imag, "o", color=RED, markerfacecolor="none", markersize=7, markeredgewidth=1.6,
        label="zeros",
    )  # fmt: skip
    axes.set_aspect("equal")
    axes.set_xlabel("Re z")
    axes.set_ylabel("Im z")


def _unit_circle() -> Any:
    from matplotlib.patches import Circle

    return Circle((0, 0), 1.0, fill=False, linestyle=":", linewidth=1.2, edgecolor=INK)


def _gains(breakaway: float, reentry: float) -> NDArray[np.float64]:
    """Gains from 0 to nearly infinity, dense where two poles meet and their paths turn off sharply."""
    fine = 1 + np.concatenate([-np.geomspace(1e-6, 0.2, 60), [0.0], np.geomspace(1e-6, 0.2, 60)])
    wide = np.geomspace(breakaway / 50, reentry * 500, 900)
    return np.unique(np.concatenate([[0.0], breakaway * fine, reentry * fine, wide]))


def _annotate(axes: Axes, place: complex, text: str, offset: tuple[float, float]) -> None:
    axes.plot([place.real], [place.imag], ".", color=INK, markersize=7)
    axes.annotate(
        text,
        (place.real, place.imag),
        xytext=offset,
        textcoords="offset points",
        fontsize=8.5,
        color=INK,
        arrowprops={"arrowstyle": "-", "color": GREY, "linewidth": 0.8},
    )


@styled
def figure_6_5(design: ServoDesign) -> Figure:
    """Root locus of the uncompensated loop: stable only below K = (1 − p)/(g b)."""
    figure, axes = new_figure(9.6, 4.6, ncols=2)
    plant = design.discrete
    bare = Filter(0.0, 0.0, 1.0)
    limit = uncompensated_gain_limit(plant)
    gain, place = uncompensated_breakaway(plant)
    crossing = closed_loop_poles(plant, Filter(0.0, 0.0, limit))[:2]
    # The two real branches meet again beyond the zero: k of the discriminant's other root.
    reentry = 2 * ((1 + plant.pole) + 2 * plant.zero) / plant.gain - gain
    for ax in axes:
        draw_root_locus(ax, plant, bare, _gains(gain, reentry))
    upper = next(z for z in crossing if z.imag > 0)
    at_one = next(z for z in closed_loop_poles(plant, Filter(0.0, 0.0, 1.0)) if z.imag > 0)
    axes[0].set_xlim(-3.9, 1.6)
    axes[0].set_ylim(-2.3, 2.3)
    axes[0].set_title("Without compensation")
    axes[0].legend(loc="lower left", fontsize=8.5)
    axes[1].set_xlim(0.74, 1.04)
    axes[1].set_ylim(-0.66, 0.66)
    axes[1].set_aspect("auto")
    axes[1].set_title("near z = 1")
    _annotate(axes[1], complex(place, 0), f"poles meet\nK = {gain:.4f}", (-92, -40))
    _annotate(axes[1], upper, f"leaves the unit circle\nK = {limit:.3f}", (18, -4))
    _annotate(axes[1], at_one, f"K = 1: |z| = {abs(at_one):.4f}", (14, 12))
    return figure


@styled
def figure_6_6(design: ServoDesign) -> Figure:
    """Root locus with the plant's pole cancelled: stable to K = 1/(g b), double pole at the design gain."""
    figure, axes = new_figure(6.4, 4.6)
    plant, controller = design.discrete, design.filter
    limit = compensated_gain_limit(plant)
    draw_root_locus(axes, plant, controller, _gains(*double_pole_gains(plant)))
    double = complex(closed_loop_poles(plant, controller)[1].real, 0)
    edge = next(z for z in closed_loop_poles(plant, Filter(plant.pole, 0.0, limit)) if z.imag > 1e-6)
    real = (
        next(z for z in design.poles if z.imag > 1e-6) if any(z.imag > 1e-6 for z in design.poles) else double
    )
    axes.set_xlim(-3.6, 1.8)
    axes.set_ylim(-2.1, 2.1)
    axes.set_title("With A = p, B = 0")
    _annotate(axes, double, f"double pole {double.real:.3f}\nK = {controller.gain:.2f}", (-16, -84))
    _annotate(axes, edge, f"leaves the unit circle\nK = {limit:.2f}", (20, 34))
    axes.plot(
        [real.real, real.real], [real.imag, -real.imag], "d", color=GREEN, markersize=6,
        label=f"nearest bytes, K = {design.registers.gain / 4:.2f}",
    )  # fmt: skip
    axes.legend(loc="lower left", fontsize=8.5)
    return figure


@styled
def figure_6_7(design: ServoDesign, printed: Filter, step: int = 100) -> Figure:
    """Step response: the linear design, and the same step in counts through DAC, encoder and nearest bytes."""
    figure, axes = new_figure(6.4, 4.0)
    period = design.discrete.period
    samples = 22
    time = np.arange(samples) * period * 1e3
    linear = simulate_linear(design.plant, printed.zero, printed.pole, printed.gain, period, np.ones(samples))
    counts = simulate_position(design.plant, design.registers, [step] * samples)
    axes.axhspan(0.98, 1.02, color="#eef3f8", linewidth=0)
    axes.axhline(1.0, color=GREY, linewidth=0.8)
    axes.plot(time, linear, "-o", color=BLUE, markersize=4, label=f"linear, K = {printed.gain:.2f} (6.12)")
    axes.step(
        time, counts.counts / step, where="post", color=GREEN, linewidth=1.3,
        label=f"{step} counts, 8-bit DAC, bytes {design.registers.zero}, {design.registers.pole}, "
        f"{design.registers.gain}",
    )  # fmt: skip
    axes.set_xlim(0, time[-1])
    axes.set_ylim(0, 1.1)
    axes.set_xlabel("time after the step (ms)")
    axes.set_ylabel("position / step")
    axes.set_title("Step response of the vergence motor")
    axes.annotate("±2 %", (time[-1] * 0.93, 1.03), fontsize=8.5, color=GREY)
    axes.legend(loc="lower right", fontsize=8.5)
    return figure
