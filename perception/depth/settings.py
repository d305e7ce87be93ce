"""What can be chosen, and the two presets: the pipeline of the thesis to the letter, and the better default."""

from dataclasses import dataclass, replace
from enum import Enum

from perception.depth.errors import OptionError


class Equalisation(Enum):
    """What is taken out of the window before grey levels are compared."""

    NONE = "none"
    """(2.6), (2.7): nothing."""
    MEAN_RATIO = "mean-ratio"
    """(2.8): the ratio of the means, where the window has texture. Removes a gain, not an offset."""


@dataclass(frozen=True)
class DepthSettings:
    """The estimator's settings; lengths in metres and pixels of the finest level."""

    near: float = 0.1
    """Nearest depth searched, m."""
    far: float = 200.0
    """Farthest depth searched, m."""
    literal: bool = False
    """Match as the thesis does: a search in two dimensions around the prediction, level by level."""
    levels: int = 3
    """Levels of the Gaussian pyramid (2.5)."""
    max_hypotheses: float = 12e6
    """More planes times pixels than this are not searched on the finest level but on the next coarser one."""
    p1: float = 0.4
    p2: float = 1.5
    """Penalties of the scanline aggregation for one plane and for more, as parts of the greatest matching cost."""
    stiffness: float = 0.1
    """How fast the predicted depth loses its hold on the search away from it, a part of the greatest cost per χ²."""
    distinctness: float = 0.07
    """By how much the best plane should be cheaper than the mean; what is missing is its ambiguity."""
    ambiguous_px: float = 3.0
    """Deviation of a match of full ambiguity, beside everything else."""
    window_radius: int = 4
    """Half the window of the error surface: a tent of 9×9, which averages like a flat 7×7."""
    equalisation: Equalisation = Equalisation.MEAN_RATIO
    """What the literal match takes out of the window; the default's error surface always fits mean and contrast."""
    epipolar_std_px: float = 0.15
    """How far a match may lie off its epipolar line: the soft epipolar term as a standard deviation."""
    epipolar_weight: float = 5.0
    """λ_ep of (2.7), (2.8), in squared grey levels per px²; for the literal match."""
    unrefined_px: float = 0.35
    """Deviation of a confirmed match whose error surface shows no minimum."""
    curvature_part: float = 0.5
    """Deviation where the surface curves within the window, as a part of how far it leaves the plane."""
    step_part: float = 0.3
    """Deviation beside a step of the disparity, as a part of the step."""
    hole_part: float = 0.5
    """Deviation of a filled hole, as a part of the spread of the disparities around it."""
    tear_px: float = 0.8
    """Step of the disparity that halves the membrane's spring."""
    strength: float = 4.0
    """λ of (2.15)."""
    membrane_iterations: int = 3
    repeated_part: float = 0.025
    """The part of a match's variance that the next pair repeats: what interpolation and the window's shape leave."""
    drift: float = 0.0004
    """Process noise: standard deviation that a step of the motion adds, as a part of the depth."""
    gate: float = 3.0
    """Standard deviations beyond which a prediction and a measurement are two surfaces."""
    reach_px: float = 1.0
    """… and pixels of disparity beyond which they are, however uncertain."""
    start_depth: float = 12.0
    """Depth that the literal preset assumes of every pixel at first, m."""
    start_std: float = 0.5
    """Its standard deviation, as a part of its inverse depth."""

    def __post_init__(self) -> None:
        if not 0 < self.near < self.far:
            raise OptionError(f"near = {self.near}, far = {self.far}: depths with 0 < near < far are needed")
        if not (0 <= self.p1 <= 1 and 0 <= self.p2 <= 1.5):
            raise OptionError(f"p1 = {self.p1}, p2 = {self.p2}: 0 to 1 and 0 to 1.5, as paths are in bytes")
        if not 1 <= self.levels <= 6:
            raise OptionError(f"levels = {self.levels}: 1 to 6 levels")


DEFAULT = DepthSettings()

THESIS = DepthSettings(
    literal=True,
    equalisation=Equalisation.MEAN_RATIO,
    epipolar_weight=5.0,
    window_radius=3,
    levels=3,
    strength=4.0,
    membrane_iterations=20,
    drift=0.0,
)
"""Chapter 2 to the letter: window 7×7, λ = 1 of (2.16), which is 4 of (2.15), λ_ep = 5, three levels."""

PRESETS = {
    "default": DEFAULT,
    "thesis": THESIS,
    "thesis-unequalised": replace(THESIS, equalisation=Equalisation.NONE),
}
