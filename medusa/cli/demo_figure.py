"""The demo's picture: angles, motor commands, switches and sensors over time."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from medusa.mc3000.board import Inputs, Mode

if TYPE_CHECKING:
    from medusa.head.drive import JointState, Reading

COLOURS = {"pan": "#1b4f72", "tilt": "#b9770e", "left_vergence": "#1e8449", "right_vergence": "#943126"}
STATES = (
    ("home sensor", Inputs.HOME, 1.0),
    ("limit switch", Inputs.NEGATIVE_LIMIT | Inputs.POSITIVE_LIMIT, 0.55),
)


def draw_demo(film: "Sequence[Reading]", marks: Sequence[tuple[str, float]], path: Path) -> None:
    """Write the picture; raises OSError when it cannot be written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    figure = Figure(figsize=(11, 8), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("medusa-ctl demo: home, look around, park", fontsize=13, x=0.01, ha="left")
    axes: Any = figure.subplots(3, 1, sharex=True, height_ratios=(4, 2, 1.6))
    times = [reading.time for reading in film]
    for name, colour in COLOURS.items():
        joints = [reading.joints[name] for reading in film]
        label = name.replace("_", " ")
        axes[0].plot(times, [math.degrees(j.angle) for j in joints], color=colour, lw=1.8, label=label)
        axes[0].plot(times, [_commanded_deg(j) for j in joints], color="#222222", lw=0.8, ls=(0, (2, 2)))
        axes[1].step(times, [j.device.motor_command for j in joints], color=colour, lw=1.1, where="post")
    axes[0].plot([], [], color="#222222", lw=0.8, ls=(0, (2, 2)), label="commanded")
    _mark(axes, marks)
    axes[0].set_ylabel("joint angle [°]")
    axes[0].legend(ncols=5, loc="lower left", bbox_to_anchor=(0.0, 1.06), frameon=False, borderaxespad=0.0)
    axes[1].set_ylabel("motor command\n[DAC counts]")
    axes[1].set_ylim(-135, 135)
    axes[1].set_yticks([-128, -64, 0, 64, 127])
    _draw_states(axes[2], film, times)
    axes[2].set_xlabel("time since the head was connected [s]")
    axes[0].set_xlim(times[0], times[-1])
    for each in axes:
        each.set_axisbelow(True)
        each.grid(axis="y", color="#dddddd", lw=0.6)
        each.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)


def _commanded_deg(joint: "JointState") -> float:
    """The command position while something holds to it; an idle chip's is a leftover."""
    return math.nan if joint.device.mode is Mode.IDLE else math.degrees(joint.commanded)


def _mark(axes: Any, marks: Sequence[tuple[str, float]]) -> None:
    start = 0.0
    for index, (name, end) in enumerate(marks):
        for each in axes:
            each.axvline(end, color="#bbbbbb", lw=0.7)
        height = 1.01 if index % 2 == 0 else 1.045
        last = index == len(marks) - 1
        axes[0].text(
            end if last else (start + end) / 2,
            height,
            name,
            transform=axes[0].get_xaxis_transform(),
            ha="right" if last else "center",
            fontsize=8,
        )
        start = end


def _draw_states(axes: Any, film: "Sequence[Reading]", times: Sequence[float]) -> None:
    """A lane a joint: where its home sensor is on, where a limit switch is closed."""
    for lane, (name, colour) in enumerate(COLOURS.items()):
        for _, bits, strength in STATES:
            on = [bool(reading.joints[name].device.inputs & bits) for reading in film]
            height = 0.34 if bits == Inputs.HOME else 0.8
            axes.fill_between(
                times,
                lane - height / 2,
                lane + height / 2,
                where=on,
                step="post",
                color=colour if bits == Inputs.HOME else "#111111",
                alpha=strength,
                lw=0,
            )
    axes.set_yticks(range(len(COLOURS)), [name.replace("_", " ") for name in COLOURS], fontsize=8)
    axes.set_ylim(len(COLOURS) - 0.4, -0.6)
    axes.set_ylabel("home sensor (colour)\nlimit switch (black)", fontsize=8)
