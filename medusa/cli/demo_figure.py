"""The demo's picture: angles, motor commands, switches and sensors over time."""

import math
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from medusa.mc3000.board import AxisSnapshot, Inputs

if TYPE_CHECKING:
    from medusa.head.drive import JointState, Reading

COLOURS = {"pan": "#1b4f72", "tilt": "#b9770e", "left_vergence": "#1e8449", "right_vergence": "#943126"}
STATES = (
    ("home sensor", Inputs.HOME, 1.0),
    ("limit switch", Inputs.NEGATIVE_LIMIT | Inputs.POSITIVE_LIMIT, 0.55),
)


def draw_demo(readings: "Sequence[Reading]", marks: Sequence[tuple[str, float]], path: Path) -> None:
    """Write the picture, with what the chips show where there are any; raises OSError when it cannot be written."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg
    from matplotlib.figure import Figure

    has_chips = all(isinstance(joint.device, AxisSnapshot) for joint in readings[0].joints.values())
    heights = (4.0, 2.0, 1.6) if has_chips else (4.0,)
    figure = Figure(figsize=(11, 2.6 + sum(heights) * 0.71), layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle("medusa-ctl demo: home, look around, park", fontsize=13, x=0.01, ha="left")
    axes: Any = figure.subplots(len(heights), 1, sharex=True, height_ratios=heights, squeeze=False)[:, 0]
    times = [reading.time for reading in readings]
    for name, colour in COLOURS.items():
        joints = [reading.joints[name] for reading in readings]
        label = name.replace("_", " ")
        axes[0].plot(times, [math.degrees(j.angle) for j in joints], color=colour, lw=1.8, label=label)
        axes[0].plot(times, [_commanded_deg(j) for j in joints], color="#222222", lw=0.8, ls=(0, (2, 2)))
    axes[0].plot([], [], color="#222222", lw=0.8, ls=(0, (2, 2)), label="commanded")
    _mark(axes, marks)
    axes[0].set_ylabel("joint angle [°]")
    axes[0].legend(ncols=5, loc="lower left", bbox_to_anchor=(0.0, 1.06), frameon=False, borderaxespad=0.0)
    if has_chips:
        _draw_commands(axes[1], readings, times)
        _draw_states(axes[2], readings, times)
    axes[-1].set_xlabel("time since the head was connected [s]")
    axes[0].set_xlim(times[0], times[-1])
    for each in axes:
        each.set_axisbelow(True)
        each.grid(axis="y", color="#dddddd", lw=0.6)
        each.spines[["top", "right"]].set_visible(False)
    figure.savefig(path, dpi=130)


def _draw_commands(axes: Any, readings: "Sequence[Reading]", times: Sequence[float]) -> None:
    for name, colour in COLOURS.items():
        commands = [reading.joints[name].device.motor_command for reading in readings]
        axes.step(times, commands, color=colour, lw=1.1, where="post")
    axes.set_ylabel("motor command\n[DAC counts]")
    axes.set_ylim(-135, 135)
    axes.set_yticks([-128, -64, 0, 64, 127])


def _commanded_deg(joint: "JointState") -> float:
    """The command position while something holds to it; an idle chip's is a leftover."""
    return math.degrees(joint.commanded) if joint.enabled else math.nan


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


def _draw_states(axes: Any, readings: "Sequence[Reading]", times: Sequence[float]) -> None:
    """A lane a joint: where its home sensor is on, where a limit switch is closed."""
    for lane, (name, colour) in enumerate(COLOURS.items()):
        for _, bits, strength in STATES:
            on = [bool(reading.joints[name].device.inputs & bits) for reading in readings]
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
