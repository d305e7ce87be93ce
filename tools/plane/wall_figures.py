"""The figures of the plane experiment."""

from math import erf
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from matplotlib.ticker import FormatStrFormatter, LogLocator, NullFormatter

from perception.plane.inverse_perspective import InversePerspective
from perception.plane.plane_motion import BELIEVED
from tools.plane.style import COLOURS, INK, SOFT, STYLE, save
from tools.plane.table_4_1 import FX, FY, SIDE, flow_at, try_affine
from tools.plane.wall_scores import BOUND, OURS, STEPS_TO_CONTACT, YAWS_DEG, Contact

NEEDED, GOAL = (0.8, 0.4, 0.2, 0.1, 0.3), (0.3, 0.15, 0.07, 0.04, 0.1)


def draw_contact(path: Path, table: dict[str, Any]) -> None:
    """Median error of the time to contact over the steps that are left, both yaws, all methods."""
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(1, 2, figsize=(10.5, 4.0), layout="constrained", sharey=True)
        names = [name for name in table if name not in ("cover_68_95", BOUND)]
        for axes, yaw in zip(panels, YAWS_DEG, strict=True):
            axes.plot(STEPS_TO_CONTACT, NEEDED, color=SOFT, lw=6, solid_capstyle="round", label="needed")
            axes.plot(STEPS_TO_CONTACT, GOAL, color=SOFT, lw=2, ls="--", label="goal")
            least = [table[BOUND][f"yaw {yaw}, {steps}"]["median_percent"] for steps in STEPS_TO_CONTACT]
            axes.plot(STEPS_TO_CONTACT, least, color=INK, lw=0.9, ls=":", label=BOUND)
            for name, colour in zip(names, COLOURS, strict=False):
                values = [table[name][f"yaw {yaw}, {steps}"]["median_percent"] for steps in STEPS_TO_CONTACT]
                style = {"lw": 2.2, "zorder": 3} if name == OURS else {"lw": 1.2}
                axes.plot(STEPS_TO_CONTACT, values, "o-", ms=3.5, color=colour, label=name, **style)
            axes.set(xscale="log", yscale="log", ylim=(0.008, 500), title=f"Wall turned by {yaw}°")
            axes.set_xticks(STEPS_TO_CONTACT, [str(steps) for steps in STEPS_TO_CONTACT])
            axes.xaxis.set_minor_formatter(NullFormatter())
            axes.yaxis.set_major_locator(LogLocator(subs=(1.0,)))
            axes.yaxis.set_major_formatter(FormatStrFormatter("%g"))
            axes.invert_xaxis()
            axes.set_xlabel("steps to contact")
        panels[0].set_ylabel("median error of the time to contact, %")
        panels[1].legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(1.01, 1.0))
        save(figure, path)


def draw_changed(path: Path, scores: dict[str, list[dict[str, Contact]]]) -> None:
    """Error with something before the wall or in other light, and the part of the window that agrees."""
    with plt.rc_context(STYLE):
        figure, (left, right) = plt.subplots(
            1, 2, figsize=(10.5, 4.4), layout="constrained", width_ratios=(3, 2)
        )
        names, rows = list(next(iter(scores.values()))[0]), np.arange(len(scores))[::-1]
        for k, (name, colour) in enumerate(zip(names, (COLOURS[0], COLOURS[2], COLOURS[3]), strict=True)):
            values = [100 * np.median([abs(pair[name].error) for pair in pairs]) for pairs in scores.values()]
            left.barh(rows + 0.27 * (1 - k), np.maximum(values, 1e-3), 0.25, color=colour, label=name)
        left.axvline(0.3, color=INK, lw=0.8, ls=":")
        left.text(0.31, rows[0] + 0.52, ".3 %", fontsize=7.5, va="bottom")
        left.set(
            xscale="log",
            xlabel="median error of the time to contact, %",
            title="25 steps to contact, yaw 0 and 20°",
        )
        left.xaxis.set_major_formatter(FormatStrFormatter("%g"))
        left.set_yticks(rows, list(scores))
        figure.legend(fontsize=8, loc="outside lower center", ncols=3)
        inliers = [[pair[OURS].inliers for pair in pairs] for pairs in scores.values()]
        box = right.boxplot(
            inliers, positions=rows, orientation="horizontal", widths=0.5, whis=(5, 95), showfliers=False
        )
        for part in ("boxes", "whiskers", "caps", "medians"):
            for line in box[part]:
                line.set(color=COLOURS[0])
        right.axvspan(0, BELIEVED, color="#c8651b", alpha=0.12, lw=0)
        right.text(
            BELIEVED - 0.01, rows[-1] - 0.62, "not believed", ha="right", fontsize=7.5, color="#c8651b"
        )
        right.set(
            xlim=(0.3, 1.01),
            ylim=left.get_ylim(),
            xlabel="part of the window that agrees (5, 25, 50, 75, 95 %)",
        )
        right.set_yticks(rows, [""] * len(rows))
        save(figure, path)


def draw_honesty(path: Path, deviations: dict[str, list[float]]) -> None:
    """How many errors lie within so many stated deviations, against the normal distribution."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(5.2, 3.9), layout="constrained")
        bound = np.linspace(0, 3, 121)
        normal = np.array([erf(value / 2**0.5) for value in bound])
        axes.plot(bound, 100 * normal, color=SOFT, lw=5, label="normal distribution")
        for (name, values), colour in zip(deviations.items(), COLOURS, strict=False):
            off = np.abs([value for value in values if np.isfinite(value)])
            axes.plot(
                bound, [100 * np.mean(off < limit) for limit in bound], color=colour, lw=1.4, label=name
            )
        axes.set(xlabel="stated deviations", ylabel="errors within, %", xlim=(0, 3), ylim=(0, 101))
        axes.legend(fontsize=8, loc="lower right")
        save(figure, path)


def draw_inverse_perspective(path: Path) -> None:
    """The counterpart of figure 4.5: synthetic flow of a floor, and the same seen from above, at three noises."""
    rng = np.random.default_rng(45)
    x, y = (part.ravel() for part in np.meshgrid(np.arange(-112, 113, 28.0), np.arange(-112, 113, 28.0)))
    with plt.rc_context(STYLE):
        figure, panels = plt.subplots(2, 3, figsize=(10.0, 6.6), layout="constrained")
        for column, sigma in enumerate((0.0, 1.0, 2.0)):
            u, v = (part + rng.normal(0, sigma, x.shape) for part in flow_at(x, y, quadratic=True))
            tilt = try_affine(rng, sigma, quadratic=False, normal=False).tilt
            view = InversePerspective(float(np.radians(tilt)), 0.0, FX, FY)
            place, moved = view.project(x, y), view.project_flow(x, y, u, v)
            above, below = panels[0, column], panels[1, column]
            above.quiver(x, y, u, v, angles="xy", scale_units="xy", scale=1, width=0.005, color=COLOURS[0])
            below.quiver(
                *place, *moved, angles="xy", scale_units="xy", scale=1, width=0.005, color=COLOURS[2]
            )
            above.set(
                title=f"noise {sigma:g} px a frame, estimated tilt {tilt:.1f}°",
                aspect="equal",
                xlabel="x, px (left)",
            )
            above.set(xlim=(-SIDE / 2 - 12, SIDE / 2 + 12), ylim=(-SIDE / 2 - 30, SIDE / 2 + 12))
            above.invert_xaxis()
            below.invert_xaxis()
            length = np.hypot(*moved)
            below.set(
                title=f"seen from above: length {np.mean(length):.1f} ± {np.std(length):.1f} px",
                aspect="equal",
                xlabel="$x_H$, px (left)",
            )
        panels[0, 0].set_ylabel("image, y, px (up)")
        panels[1, 0].set_ylabel("horizontal plane, $y_H$, px (forward)")
        save(figure, path)
