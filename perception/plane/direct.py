"""The motion of a plane between two images, from the grey levels themselves: warped and iterated coarse to fine."""

import numpy as np
from numpy.typing import NDArray

from perception.plane.errors import PlaneError
from perception.plane.plane_motion import BELIEVED, PlaneMotion, from_delta
from perception.plane.second_image import DOUBLE, SecondImage
from perception.plane.selection import Equations, Selection, reweigh, search_blocks, select_blocks
from perception.plane.template import MOTIONS, Level, Template, halve

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
ITERATIONS = 6
STILL_PX = 0.008
"""A step that moves no pixel of the window farther ends the iteration: the next would be a tenth of it."""
COARSE_STILL_PX = 0.3
NEAR_PX = 1.0
"""After a step so small, or this many of them, the blocks that disagree are no longer so for want of iterations."""
NEAR_STEPS = 3
AGREED = 0.8
"""When the blocks that agree are a smaller part, another plane is sought that more of them agree on."""
UNEVEN = 0.25
"""By so much larger must the part be that agrees when each block has its own offset, for light that falls unevenly."""
NEIGHBOURS = 1.1
"""Variance of a sum over blocks over that of independent ones: edges run from one into the next."""
LEFT_OUT = 2
"""Terms of the series of a block's pull on the solution."""


def estimate_plane_motion(
    template: Template,
    image: NDArray[np.uint8] | Field,
    prior: Matrix | None = None,
    tolerance_px: float = 0.0,
) -> PlaneMotion | None:
    """The homography from the template's image to another, of the plane that most of the window shows.

    Gauss–Newton on Σ w [b(Hx) − (1 + g + g_x x + g_y y) a(x) − o]², H ← H (I + Δ)⁻¹, w being weights of the blocks. The
    second image is softened as its scale asks, so that both show the same.

    Args:
        image: grey, as large as the template's.
        prior: a homography in pixels to begin with, from odometry for example; the coarse levels are left out then.
        tolerance_px: how far a lens that is not quite straightened or a surface that is not quite flat shifts things;
            blocks no farther off than this agree. It costs sharpness against what stands before the plane.

    Returns:
        None when three quarters of the window are not seen in the second image, or it shows nothing but noise.

    Raises:
        PlaneError: the sizes differ, or the prior holds a value that is no number.
    """
    if image.shape != template.shape:
        raise PlaneError(
            f"an image of {image.shape[1]}×{image.shape[0]} pixels and a template of one of"
            f" {template.shape[1]}×{template.shape[0]}: they must be of one size"
        )
    if prior is not None and not np.isfinite(prior).all():
        raise PlaneError(f"a prior homography of finite numbers is needed, not {np.asarray(prior).tolist()}")
    second = np.asarray(image, np.float32)
    start, weights = _estimate_coarse(template, second) if prior is None else (np.asarray(prior, float), None)
    alignment = _Alignment(template.finest, second, start, tolerance_px)
    selection = alignment.iterate(STILL_PX, weights)
    return None if selection is None else _report(alignment, selection)


def _estimate_coarse(template: Template, image: Field) -> tuple[Matrix, Matrix | None]:
    """The homography for the finest level, and the weights of the blocks where it was found."""
    images = [image]
    for _ in template.coarser:
        images.append(halve(images[-1]))
    homography, weights, agreed = np.eye(3), None, False
    for level, small in zip(reversed(template.coarser), reversed(images[1:]), strict=True):
        # What nearly all of a coarse level agree on is good enough for the finest.
        if not agreed:
            alignment = _Alignment(level, small, homography)
            selection = alignment.iterate(COARSE_STILL_PX)
            if selection is not None:
                homography, weights = alignment.homography, selection.following
                agreed = selection.agreeing >= AGREED * alignment.equations.number
        homography = DOUBLE @ homography @ np.linalg.inv(DOUBLE)
    return homography, weights


class _Alignment:
    """A level of the template, the second image, and the homography between them so far, in the level's pixels."""

    equations: Equations

    def __init__(self, level: Level, image: Field, homography: Matrix, tolerance_px: float = 0.0) -> None:
        self.level, self.homography = level, homography
        self._tolerance = tolerance_px**2 * level.texture if tolerance_px else np.zeros(level.window.count)
        self._second = SecondImage(image, level.window, homography)

    def iterate(self, still_px: float, weights: Matrix | None = None) -> Selection | None:
        """Gauss–Newton until it stands still; None when too little is seen or it leaps out of the window."""
        selection: Selection | None = None
        searched = uneven = False
        for k in range(ITERATIONS):
            equations = self._linearise()
            if equations is None:
                return None
            if uneven:
                equations = equations.with_own_offsets()
            if selection is not None:
                weights = selection.following
            if weights is None or len(weights) != len(equations.seen):
                selection = select_blocks(equations)
            else:
                selection = reweigh(equations, weights)
            moved_px = self._moved_px(selection)
            still, near = moved_px < still_px, moved_px < NEAR_PX or k + 1 == NEAR_STEPS
            if near and not searched and selection.agreeing < AGREED * equations.number:
                searched, still = True, False
                equations, selection, uneven = self._search(equations, selection)
                moved_px = self._moved_px(selection)
            if not moved_px < self.level.window.half:
                return None
            self.equations = equations
            self._step(selection)
            if still:
                break
        return selection

    def _moved_px(self, selection: Selection) -> float:
        with np.errstate(divide="ignore", invalid="ignore"):
            return float(np.abs(_delta(selection)).max() * self.level.window.half)

    def _search(self, equations: Equations, known: Selection) -> tuple[Equations, Selection, bool]:
        """The plane that most blocks agree on; and whether each block needs its own offset for that."""
        columns = self.level.window.columns
        selection = search_blocks(equations, columns, known)
        if selection.agreeing < BELIEVED * equations.number:
            own = equations.with_own_offsets()
            other = search_blocks(own, columns, reweigh(own, selection.following))
            if other.agreeing > selection.agreeing + UNEVEN * own.number:
                return own, other, True
        return equations, selection, False

    def _step(self, selection: Selection) -> None:
        window = self.level.window
        inside = window.to_pixels @ np.linalg.inv(from_delta(_delta(selection))) @ window.from_pixels
        self.homography = self.homography @ inside
        self.homography /= self.homography[2, 2]

    def _linearise(self) -> Equations | None:
        if self._second.hidden:
            return None
        level = self.level
        residual = level.window.by_blocks(self._second.warped(self.homography))
        residual -= level.grey
        energy = np.einsum("bi,bi->b", residual, residual).astype(np.float64)
        seen = np.isfinite(energy)
        if not seen.all():
            if seen.sum() <= len(seen) // 4:
                return None
            residual[~seen] = 0
            energy[~seen] = 0
        right = (level.jacobian @ residual[:, :, None])[:, :, 0].astype(np.float64)
        return Equations(level.gram, right, energy, residual.shape[1], seen, self._tolerance)


def _correlate(grams: Matrix, weights: Matrix, gain: float, variance: float, pixels: int) -> float:
    """Of the blocks of the two images, each less its mean: what the fit explains of the second."""
    contrast = grams[:, MOTIONS, MOTIONS] - grams[:, MOTIONS, -1] ** 2 / pixels
    explained = gain**2 * float(weights @ contrast) / (float(weights.sum()) * pixels)
    return float(np.sqrt(explained / (explained + variance)))


def _delta(selection: Selection) -> Matrix:
    # The model's slopes are those of the first image, the residual's those of the second.
    return np.asarray(selection.solution[:MOTIONS] / (1 + selection.solution[MOTIONS]))


def _report(alignment: _Alignment, selection: Selection) -> PlaneMotion | None:
    """Covariance A⁻¹ (Σ s sᵀ) A⁻¹ over the blocks' scores s, each of a fit from which its block was left out."""
    equations, weights, window = alignment.equations, selection.weights, alignment.level.window
    normal = equations.normal(weights)
    # What noise adds to JᵀJ says nothing of the motion. Half of the residual's variance is the template's own.
    normal[:MOTIONS, :MOTIONS] -= alignment.level.slope_noise(weights, selection.variance / 2)
    if np.linalg.eigvalsh(normal[:MOTIONS, :MOTIONS])[0] <= 0:
        # There is no texture but noise: nothing is known in some direction.
        return None
    inverse = np.linalg.inv(normal)
    grams = equations.gram.reshape(len(weights), *inverse.shape)
    pull = (grams.reshape(-1, len(inverse)) @ selection.solution).reshape(equations.right.shape)
    scores = weights[:, None] * (equations.right - pull)
    left_out = scores
    for _ in range(LEFT_OUT):
        # (I − P)⁻¹ s by its series, P = w_b A_b A⁻¹ being the block's own pull on the solution.
        left_out = scores + weights[:, None] * np.einsum("bij,bj->bi", grams, left_out @ inverse)
    gain = 1 + float(selection.solution[MOTIONS])
    covariance = NEIGHBOURS / gain**2 * (inverse @ (left_out.T @ left_out) @ inverse)
    information = gain**2 * np.linalg.inv(inverse[:MOTIONS, :MOTIONS])
    return PlaneMotion(
        alignment.homography,
        window,
        covariance[:MOTIONS, :MOTIONS],
        information,
        selection.solution[MOTIONS:],
        float(np.sqrt(selection.variance)),
        float(weights.sum() / equations.number),
        _correlate(grams, weights, gain, selection.variance, equations.pixels),
        weights.reshape(window.rows, window.columns),
    )
