"""The motion of a plane between two images, with its uncertainty."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.plane.window import Window

Matrix = NDArray[np.float64]
BELIEVED = 0.6
"""Part of the window that must move with the plane for it to be believed."""
VAGUE_PX = 0.5
"""A motion known no better than this is not known."""
BARE = 0.7
"""Images that correlate less show noise: a fit follows it, and its deviation does not say so."""
PLACES = ((0, 2), (0, 0), (0, 1), (1, 2), (1, 0), (1, 1), (2, 0), (2, 1))
"""Where δ₀ … δ₇ stand in Δ."""


@dataclass(frozen=True, eq=False)
class PlaneMotion:
    """x₂ ~ H x₁ in pixels, and what is known of an error Δ: the true one is H (I + Δ) in the window's coordinates.

    Δ = [[δ₁, δ₂, δ₀], [δ₄, δ₅, δ₃], [δ₆, δ₇, 0]], so that δ₀ and δ₃ shift, δ₁, δ₂, δ₄, δ₅ are the slopes of the
    affine flow (4.9) and δ₆, δ₇ its quadratic terms.
    """

    homography: Matrix
    window: Window
    covariance: Matrix
    """Of δ, 8 × 8."""
    information: Matrix
    """Weight of δ in a least-squares fit, 8 × 8: JᵀJ without what the light explains."""
    light: Matrix
    """g, g_x, g_y, o: the second image shows (1 + g + g_x x + g_y y) a + o where the first shows a."""
    noise: float
    """Root mean square residual of what moves with the plane, grey levels."""
    inliers: float
    """Part of the window that moves with the plane, 0 to 1."""
    correlation: float
    """Of the two images within the blocks, 0 to 1: low where there is little texture beside the noise."""
    weights: Matrix
    """How much each block counts, rows × columns."""

    @property
    def deviation_px(self) -> float:
        """Root mean square deviation of where the window's pixels are seen, over the window."""
        products = self.window.flow_products().sum(axis=0).reshape(self.covariance.shape)
        pixels = self.window.width * self.window.height
        return self.window.half * float(np.sqrt(np.sum(products * self.covariance) / pixels))

    @property
    def known(self) -> bool:
        """Whether there is texture, and the motion follows from it."""
        return self.correlation >= BARE and self.deviation_px <= VAGUE_PX

    @property
    def believed(self) -> bool:
        """Whether it is known, and of so much of the window that another plane was not taken for this one."""
        return self.known and self.inliers >= BELIEVED

    @property
    def gain(self) -> float:
        """Grey levels of the second image over those of the first, in the middle of the window."""
        return 1 + float(self.light[0])

    def beyond(self, homography: Matrix) -> Matrix:
        """δ by which this motion goes beyond another: H is the other times I + Δ."""
        frame = self.window.to_pixels
        return to_delta(np.asarray(np.linalg.solve(homography @ frame, self.homography @ frame)))


def from_delta(delta: Matrix) -> Matrix:
    """I + Δ (3 × 3)."""
    u, ux, uy, v, vx, vy, p, q = delta.tolist()
    return np.array([[1 + ux, uy, u], [vx, 1 + vy, v], [p, q, 1.0]])


def to_delta(matrix: Matrix) -> Matrix:
    """δ (8) of I + Δ, which may be scaled (3 × 3)."""
    even = matrix / matrix[2, 2] - np.eye(3)
    return np.array([even[place] for place in PLACES])


def tangent(change: Matrix) -> Matrix:
    """δ (8) of a small change of the identity (3 × 3); its scale says nothing."""
    even = change - change[2, 2] * np.eye(3)
    return np.array([even[place] for place in PLACES])
