"""How well obstacles on a floor are found: ours, and other ways to the residual flow, on the same pairs."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.flow.normal import estimate_normal_flow
from perception.plane.affine_flow import estimate_affine_flow
from perception.plane.direct import estimate_plane_motion
from perception.plane.heights import measure_heights
from perception.plane.inverse_perspective import InversePerspective
from perception.plane.parallax import Parallax
from perception.plane.template import Template
from perception.plane.window import Window
from tools.plane.floors import CAMERA, SIDE, FloorCase, FloorPair, drive
from tools.plane.peers import dis_medium

Field = NDArray[np.float64]
BORDER_PX, CELL_PX, GRID_PX = 8, 16, 4
OURS = "heights over the floor"
LK, DIS, THESIS = "LK + RANSAC homography", "DIS medium + RANSAC homography", "thesis: λ of normal flow"


@dataclass(frozen=True, eq=False)
class Strength:
    """How strongly a method says that there is an obstacle: anywhere, and where it is."""

    anywhere: float
    there: float


@dataclass(frozen=True, eq=False)
class FloorScore:
    """One pair: every method's answer; of ours the heights and what the scores of the empty cells look like."""

    strengths: dict[str, Strength]
    height: float = float("nan")
    """h/H of the strongest cell."""
    std: float = float("nan")
    spread: tuple[float, ...] = ()
    """Standard deviation of the scores off the obstacle, by side of the cells."""


def watched() -> Window:
    """All but the border."""
    return Window.central((SIDE, SIDE), SIDE - 2 * BORDER_PX, SIDE - 2 * BORDER_PX)


def score_floor(job: tuple[FloorCase, bool]) -> FloorScore:
    """All methods on one case; the peers only when asked for."""
    case, peers = job
    pair = drive(case)
    strengths: dict[str, Strength] = {}
    height = std = float("nan")
    spread: tuple[float, ...] = ()
    template = Template(pair.first, watched())
    seen = estimate_plane_motion(template, pair.second, pair.floor.homography(CAMERA, pair.motion))
    if seen is None:
        strengths[OURS] = Strength(0.0, 0.0)
    else:
        parallax = Parallax.of(watched(), CAMERA, pair.motion, pair.floor.q)
        heights = measure_heights(template, pair.second, seen, parallax)
        strongest = np.nanmax(np.abs(np.nan_to_num(heights.score)), axis=0)
        on = _on(pair, heights.x_px, heights.y_px)
        strengths[OURS] = _strength(strongest, on)
        if on.any():
            there = np.abs(np.nan_to_num(heights.score)) * on
            index = np.unravel_index(np.argmax(there), there.shape)
            height, std = float(heights.height[index]), float(heights.std[index])
        off = ~_near(pair, heights.x_px, heights.y_px)
        spread = tuple(float(np.nanstd(layer[off])) for layer in heights.score)
    if peers:
        strengths |= {name: peer(pair) for name, peer in PEERS.items()}
    return FloorScore(strengths, height, std, spread)


def _strength(strongest: NDArray[Any], on: NDArray[np.bool_]) -> Strength:
    return Strength(float(np.nanmax(strongest, initial=0.0)), float(np.nanmax(strongest[on], initial=0.0)))


def _on(pair: FloorPair, x: Field, y: Field) -> NDArray[np.bool_]:
    return np.asarray(pair.obstacle[np.round(y).astype(int), np.round(x).astype(int)])


def _near(pair: FloorPair, x: Field, y: Field) -> NDArray[np.bool_]:
    wide = cv2.dilate(pair.obstacle.astype(np.uint8), np.ones((33, 33), np.uint8))
    return np.asarray(wide[np.round(y).astype(int), np.round(x).astype(int)] > 0)


def _cells() -> tuple[Field, Field]:
    middle = np.arange(BORDER_PX + CELL_PX // 2, SIDE - BORDER_PX - CELL_PX // 2 + 1, GRID_PX, dtype=float)
    x, y = np.meshgrid(middle, middle)
    return x, y


def _by_residual_flow(pair: FloorPair, here: Field, there: Field) -> Strength:
    """Median length of the residual flow against a RANSAC homography in cells of 16 px."""
    x, y = _cells()
    if len(here) < 8:
        return Strength(0.0, 0.0)
    homography, _ = cv2.findHomography(here, there, cv2.RANSAC, 1.0)
    if homography is None:
        return Strength(0.0, 0.0)
    floor = cv2.perspectiveTransform(here[None], homography)[0]
    # What has left the image tells nothing, and neither method knows.
    kept = _inside(np.asarray(floor))
    here, rest = here[kept], (floor - there)[kept]
    length = np.hypot(rest[:, 0], rest[:, 1])
    medians = np.zeros(x.shape)
    for index in np.ndindex(x.shape):
        inside = (np.abs(here[:, 0] - x[index]) <= CELL_PX / 2) & (
            np.abs(here[:, 1] - y[index]) <= CELL_PX / 2
        )
        if inside.sum() >= 4:
            medians[index] = np.median(length[inside])
    return _strength(medians, _on(pair, x, y))


def _inside(points: Field) -> NDArray[np.bool_]:
    return np.asarray(np.all((points >= BORDER_PX) & (points <= SIDE - 1 - BORDER_PX), axis=1))


def score_lk(pair: FloorPair) -> Strength:
    """Points every 4 px tracked by Lucas and Kanade in windows of 15 px."""
    grid = np.arange(BORDER_PX, SIDE - BORDER_PX, 4, dtype=np.float32)
    here = np.stack(np.meshgrid(grid, grid), axis=-1).reshape(-1, 1, 2)
    there, status, _ = cv2.calcOpticalFlowPyrLK(
        pair.first, pair.second, here, np.empty(0, np.float32), winSize=(15, 15), maxLevel=3
    )
    good = status.ravel() > 0
    return _by_residual_flow(pair, np.asarray(here[good, 0], float), np.asarray(there[good, 0], float))


def score_dis(pair: FloorPair) -> Strength:
    """The dense flow of DIS at every second pixel."""
    flow = dis_medium(pair.first, pair.second)
    grid = np.arange(BORDER_PX, SIDE - BORDER_PX, 2)
    x, y = (part.ravel() for part in np.meshgrid(grid, grid))
    here = np.stack((x, y), axis=-1).astype(float)
    return _by_residual_flow(pair, here, here + flow[y, x])


def score_thesis(pair: FloorPair) -> Strength:
    """Affine flow, tilt from it, and the ratio λ of normal flow to that of the floor, median of cells: |1 − 1/λ|."""
    window = watched()
    affine = estimate_affine_flow(pair.first, pair.second, window, CAMERA, np.random.default_rng(0))
    view = InversePerspective.from_slopes(*affine.slopes_over_focal)
    x, y = window.pixels()
    x, y = x - CAMERA.cx, y - CAMERA.cy
    v0, vx, vy, u0, ux, uy = affine.theta
    above = view.project_flow(x, y, u0 + ux * x + uy * y, v0 + vx * x + vy * y)
    direction = np.array([float(np.median(part)) for part in above])
    normal = estimate_normal_flow((pair.first, pair.second))
    strength = normal.strength[window.part]
    unit = tuple(part[window.part] / np.maximum(strength, 1e-6) for part in (normal.slope_x, normal.slope_y))
    flow = normal.flow[window.part].astype(float)
    ratio = view.ratio(x, y, (unit[0].astype(float), unit[1].astype(float)), flow, direction)
    ratio[strength < 4] = np.nan
    centre_x, centre_y = _cells()
    heights = np.zeros(centre_x.shape)
    for index in np.ndindex(heights.shape):
        row, column = int(centre_y[index]) - window.top, int(centre_x[index]) - window.left
        some = ratio[max(row - 8, 0) : row + 8, max(column - 8, 0) : column + 8]
        if np.isfinite(some).sum() >= 32:
            heights[index] = abs(1 - 1 / float(np.nanmedian(some)))
    return _strength(heights, _on(pair, centre_x, centre_y))


PEERS: dict[str, Callable[[FloorPair], Strength]] = {LK: score_lk, DIS: score_dis, THESIS: score_thesis}


def summarise(empty: list[FloorScore], boxes: dict[float, list[FloorScore]]) -> dict[str, Any]:
    """Found boxes in per cent when no empty image alarms; heights and deviations of ours; least height at 95 %."""
    table: dict[str, Any] = {}
    for name in empty[0].strengths:
        limit = max(score.strengths[name].anywhere for score in empty)
        found = {
            height: 100 * float(np.mean([score.strengths[name].there > limit for score in scores]))
            for height, scores in boxes.items()
            if name in scores[0].strengths
        }
        sure = [height for height in found if all(found[other] >= 95 for other in found if other >= height)]
        table[name] = {
            "limit": round(limit, 3),
            "found_percent": {f"{height:g}": round(part, 1) for height, part in found.items()},
            "least_height": min(sure) if sure else None,
        }
    table["spread"] = [round(float(np.median([score.spread[k] for score in empty])), 2) for k in range(3)]
    table["heights"] = {
        f"{height:g}": {
            "median": round(float(np.median([score.height for score in scores])), 4),
            "std": round(float(np.median([score.std for score in scores])), 4),
        }
        for height, scores in boxes.items()
    }
    return table


def roc(empty: list[FloorScore], boxes: list[FloorScore], name: str) -> tuple[Field, Field]:
    """Part of the empty images that alarm and of the boxes that are found, over all limits."""
    alarms = np.array([score.strengths[name].anywhere for score in empty])
    finds = np.array([score.strengths[name].there for score in boxes])
    limits = np.sort(np.concatenate((alarms, finds, [np.inf, -np.inf])))[::-1]
    return (
        np.array([float(np.mean(alarms >= limit)) for limit in limits]),
        np.array([float(np.mean(finds >= limit)) for limit in limits]),
    )
