"""How the figures of the plane and floor experiments look."""

from pathlib import Path
from typing import Any

import matplotlib

matplotlib.use("Agg")

import matplotlib.pyplot as plt
from matplotlib.figure import Figure

INK, SOFT = "#22303c", "#c9d2d9"
COLOURS = ["#0b6e8a", "#5a8f29", "#c8651b", "#8a2b5b", "#6b7a86", "#b08d1e", "#22303c"]
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


def save(figure: Figure, path: Path) -> None:
    """Write it and let it go."""
    figure.savefig(path)
    plt.close(figure)
