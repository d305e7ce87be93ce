"""The motion corrected by its epipolar residuals.

A match that lies off its line by more than its own deviation shows that the motion is wrong. An error (ω, τ) of
P' = R P + t moves q = R p + ρ t by ω × R p + ρ τ to first order, so that six numbers explain the residuals of a
whole image. What the error does along the lines looks like depth: of that only the expected size is known.
"""

from dataclasses import dataclass
from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.motion import Motion
from perception.depth.geometry.epipolar import Epipolar
from perception.depth.match.coarse_match import CoarseMatch
from perception.depth.refine.essd import BaseWindow, Window, noise_power, sample_surface
from perception.depth.settings import DepthSettings
from perception.image.quantile import median, robust_deviation

Field = NDArray[np.float32]
Vector = NDArray[np.float64]
SHARP_PX = 0.2
"""Matches at least this sharp across their line are used, pixels of the coarse level."""
FEWEST = 100
"""Fewer of them determine no motion."""
LEAST_OWN_PX = 0.03
"""No match has a smaller deviation than this, pixels of the coarse level."""
SLACK = 3.0
"""Residuals up to so many times the matches' own deviation leave the motion as it is."""
INDEPENDENT = 6.0
"""For how many all matches together count: lens and shutter shift them alike over whole parts of the image."""
ROUNDS = 10


@dataclass(frozen=True)
class Correction:
    """A motion after its correction, and what is known of its errors, pixels of the finest level."""

    motion: Motion
    residual_px: float
    """Epipolar residual of the motion that was given; 0 if it is within the matches' own deviation."""
    error_px: float
    """By how much the corrected motion may still shift a match along its line."""

    def besides(self, turned_px: float) -> "Correction":
        """The same after a turn by so many pixels across the lines, which may err as much along them."""
        residual, error = (float(np.hypot(px, turned_px)) for px in (self.residual_px, self.error_px))
        return Correction(self.motion, residual, error)


@dataclass(frozen=True)
class _Residuals:
    """The n matches that are used: their epipolar residuals and variances (px, px²), pixels, inverse depths (1/m), and
    the directions of their lines (n × 2)."""

    geometry: Epipolar
    off_line: Vector
    variance: Vector
    column: Vector
    row: Vector
    inverse_depth: Vector
    line: Vector

    @cached_property
    def across(self) -> Vector:
        """What (ω, τ) does to them across the line, n × 6."""
        return self.line[:, :1] * self._jacobian[:, 1] - self.line[:, 1:] * self._jacobian[:, 0]

    @cached_property
    def along(self) -> Vector:
        """What (ω, τ) does to them along the line, n × 6."""
        return self.line[:, :1] * self._jacobian[:, 0] + self.line[:, 1:] * self._jacobian[:, 1]

    @cached_property
    def _jacobian(self) -> Vector:
        return motion_jacobian(self.geometry, self.inverse_depth, self.column, self.row)


def correct_motion(coarse: CoarseMatch, settings: DepthSettings) -> Correction:
    """Estimate (ω, τ) from the residuals v of a coarse match: minimise Σ w (v − n·J (ω, τ))² + Σ ω²/σ_ω² + Σ τ²/σ_τ².

    n is across the line, J = ∂(x', y')/∂(ω, τ), w falls for outliers (Cauchy). Each of the six is expected to
    move the image by about as much as the residuals: σ_ω = s/f, σ_τ = s/(f ρ) with the median ρ. The
    inverse of the Hessian is then the covariance of what is left, also along the lines.
    """
    given = coarse.geometry.motion
    residuals = _find_residuals(coarse, coarse.geometry, settings)
    if len(residuals.off_line) < FEWEST:
        return Correction(given, 0.0, 0.0)
    own = max(float(np.sqrt(median(residuals.variance))), LEAST_OWN_PX)
    size = robust_deviation(residuals.off_line)
    if size <= SLACK * own:
        return Correction(given, 0.0, 0.0)
    focal, middle = coarse.geometry.camera.fx, median(residuals.inverse_depth)
    prior = np.diag(np.repeat([(focal / size) ** 2, (focal * middle / size) ** 2], 3))
    error, information = _explain(residuals, np.zeros(6), prior, own)
    corrected = _apply(error, given)
    # A surface sampled far from its minimum overshoots it: sampled once more where the first answer leads.
    again = _find_residuals(
        coarse, Epipolar(coarse.geometry.camera, corrected, coarse.geometry.shape), settings
    )
    if len(again.off_line) >= FEWEST:
        residuals = again
        error, information = _explain(residuals, error, prior, own)
        corrected = _apply(error, given)
    spread = np.einsum("ni,ij,nj->n", residuals.along, np.linalg.inv(information), residuals.along)
    return Correction(corrected, size * coarse.factor, float(np.sqrt(median(spread))) * coarse.factor)


def _explain(residuals: _Residuals, start: Vector, prior: Vector, own: float) -> tuple[Vector, Vector]:
    """The error (ω, τ) of the given motion and the Hessian, from the residuals of the motion corrected by `start`."""
    off_line = residuals.off_line + residuals.across @ start
    error, information = start, prior
    for _ in range(ROUNDS):
        rest = off_line - residuals.across @ error
        scale = max(robust_deviation(rest), own)
        weight = INDEPENDENT / len(rest) / (scale**2 + (rest / 2) ** 2)
        information = residuals.across.T @ (weight[:, None] * residuals.across) + prior
        error = np.asarray(np.linalg.solve(information, residuals.across.T @ (weight * off_line)), np.float64)
    return error, information


def _apply(error: Vector, motion: Motion) -> Motion:
    return Motion(cv2.Rodrigues(error[:3])[0] @ motion.rotation, motion.translation + error[3:])


def motion_jacobian(geometry: Epipolar, inverse_depth: Vector, column: Vector, row: Vector) -> Vector:
    """∂(x', y')/∂(ω, τ) in pixels per radian and per metre, n × 2 × 6.

    With q = R p + ρ t, ∂q/∂ω_k = e_k × R p and ∂q/∂τ_k = ρ e_k, and x' = f q₁/q₃.
    """
    camera, motion = geometry.camera, geometry.motion
    ray = np.stack(
        [(column - camera.cx) / camera.fx, (row - camera.cy) / camera.fy, np.ones_like(column)], -1
    )
    turned = ray @ motion.rotation.T
    q = turned + inverse_depth[:, None] * motion.translation
    moved = np.zeros((len(column), 3, 6))
    for axis, unit in enumerate(np.eye(3)):
        moved[:, :, axis] = np.cross(unit, turned)
        moved[:, axis, 3 + axis] = inverse_depth
    scale, place = q[:, 2, None, None], q[:, :2, None] / q[:, 2, None, None]
    focal = np.array([camera.fx, camera.fy])[:, None]
    return np.asarray(focal * (moved[:, :2] - place * moved[:, 2:]) / scale)


def _find_residuals(coarse: CoarseMatch, geometry: Epipolar, settings: DepthSettings) -> _Residuals:
    base, other, choice = coarse.base, coarse.other, coarse.choice
    window = BaseWindow(base.soft, settings.window_radius, Window.TENT)
    projection = geometry.project(choice.inverse_depth)
    surface = sample_surface(window, other.interpolated, projection)
    _, off_line, least = surface.minimum()
    power = noise_power(least, window) * np.float32(base.noise_weight)
    _, _, variance = surface.covariance(power)
    with np.errstate(invalid="ignore"):
        good = choice.confirmed & (np.abs(off_line) < 2) & (variance < SHARP_PX**2)
    rim = settings.window_radius // 2
    good[:rim] = good[-rim:] = False
    good[:, :rim] = good[:, -rim:] = False
    row, column = np.nonzero(good)
    along_x, along_y, _ = projection.line

    def used(part: Field) -> Vector:
        return part[row, column].astype(float)

    return _Residuals(
        geometry,
        used(off_line),
        used(variance),
        column.astype(float),
        row.astype(float),
        used(choice.inverse_depth),
        np.stack((used(along_x), used(along_y)), axis=-1),
    )
