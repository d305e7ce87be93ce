"""Time to contact, heading of a wall, robustness and honesty on pairs of images of a wall, peers on the same pairs."""

from collections.abc import Callable, Iterable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from os import cpu_count
from typing import Any, TypeVar

import cv2
import numpy as np

from perception.plane.affine_flow import estimate_affine_flow
from perception.plane.contact import estimate_contact
from perception.plane.direct import estimate_plane_motion
from perception.plane.metric_plane import measure_plane, plane_homography
from perception.plane.plane_motion import PlaneMotion
from perception.plane.template import SLOPE, Template
from perception.plane.window import Window
from tools.plane.peers import PEERS
from tools.plane.walls import (
    CAMERA,
    LIGHTS,
    SIDE,
    WINDOW,
    WallPair,
    approach_wall,
    heading_of,
    pitched_at_wall,
)

GRAF = "planar_graf/graf1.png"
STEPS_TO_CONTACT = (100, 50, 25, 10, 5)
STEPS_TO_WALL = (100, 50, 25, 10)
YAWS_DEG = (0, 20)
OBSTACLES = (0.1, 0.2, 0.35)
BEFORE = "planar_graf/graf3.png"
PARTS = (0.1, 0.2, 0.35)
OURS, PRIOR, THESIS = "eight parameters, direct", "the same with a prior", "thesis"
BOUND = "least that noise allows"

Job = TypeVar("Job")
Answer = TypeVar("Answer")


def in_processes(work: Callable[[Job], Answer], jobs: Iterable[Job]) -> list[Answer]:
    """What the work makes of every job, on all processors."""
    with ProcessPoolExecutor(cpu_count(), initializer=cv2.setNumThreads, initargs=(1,)) as pool:
        return list(pool.map(work, jobs, chunksize=4))


@dataclass(frozen=True)
class Contact:
    """One estimate: error of the time to contact as a part of it, in its own deviations, and whether it is believed."""

    error: float
    deviations: float = float("nan")
    believed: bool = True
    inliers: float = 1.0
    heading_error_deg: float = float("nan")


def window() -> Window:
    """The central 80 × 80 pixels."""
    return Window.central((SIDE, SIDE), WINDOW, WINDOW)


def judge(motion: PlaneMotion | None, pair: WallPair) -> Contact:
    """Against the truth; no estimate is an infinite error that is not believed."""
    if motion is None:
        return Contact(float("inf"), float("nan"), False, 0.0)
    found = estimate_contact(motion, CAMERA)
    true = 1 / pair.approach
    steps = found.steps + 1
    slope = -pair.plane[0] / pair.plane[2]
    heading = float(np.degrees(np.arctan(found.slopes[0]) - np.arctan(slope)))
    off = (found.approach - pair.approach) / found.approach_std
    return Contact(steps / true - 1, float(off), motion.believed, motion.inliers, heading)


def noise_bound(pair: WallPair, noise: float = 2.0) -> float:
    """Median error of the time to contact, as a part of it, that noise leaves to any unbiased estimator (Cramér–Rao).

    From the slopes of the first image before noise, with gain and offset unknown, and no aliasing.
    """
    there = window()
    rows, columns = there.part
    slopes = (cv2.filter2D(pair.lights[0], cv2.CV_32F, kernel).astype(float) for kernel in (SLOPE, SLOPE.T))
    across, down = (slope[rows, columns].ravel() for slope in slopes)
    x, y = (
        part.ravel() - middle for part, middle in zip(there.pixels(), there.to_pixels[:2, 2], strict=True)
    )
    x, y = x / there.half, y / there.half
    radial = -(x * across + y * down)
    grey = pair.lights[0][rows, columns].ravel()
    moved = (across, x * across, y * across, down, x * down, y * down, x * radial, y * radial)
    model = np.stack([*(there.half * part for part in moved), grey, np.ones_like(grey)], axis=1)
    covariance = np.asarray(2 * noise**2 * np.linalg.inv(model.T @ model)[:8, :8])
    homography = plane_homography(CAMERA, pair.motion, pair.plane)
    every = np.ones((there.rows, there.columns))
    exact = PlaneMotion(
        homography,
        there,
        covariance,
        np.asarray(np.linalg.inv(covariance)),
        np.zeros(4),
        1.0,
        1.0,
        1.0,
        every,
    )
    return 0.6745 * estimate_contact(exact, CAMERA).approach_std / pair.approach


def score_contact(job: tuple[str, int, int, int]) -> dict[str, Contact]:
    """All methods on one pair: texture, yaw, steps to contact, seed."""
    texture, yaw, steps, seed = job
    pair = approach_wall(texture, seed, steps, yaw)
    first, second = pair.exposed(seed)
    template = Template(first, window())
    found = {OURS: judge(estimate_plane_motion(template, second), pair)}
    # A prior as odometry and the last estimate give it: distance wrong by 5 %, heading by 3°.
    rng = np.random.default_rng(seed)
    guess = (
        cv2.Rodrigues(np.array([0, np.radians(3) * rng.normal(), 0]))[0]
        @ pair.plane
        * (1 + 0.05 * rng.normal())
    )
    prior = plane_homography(CAMERA, pair.motion, guess)
    found[PRIOR] = judge(estimate_plane_motion(template, second, prior), pair)
    for name, peer in PEERS.items():
        found[name] = judge(peer(first, second, window()), pair)
    flow = estimate_affine_flow(first, second, window(), CAMERA, np.random.default_rng(seed))
    found[THESIS] = Contact((1 / flow.approach + 1) * pair.approach - 1)
    found[BOUND] = Contact(noise_bound(pair))
    return found


def score_heading(job: tuple[str, int, int, int]) -> dict[str, float]:
    """Heading of a wall with the motion known: texture, heading, distance over step, seed."""
    texture, heading, ratio, seed = job
    pair = pitched_at_wall(texture, seed, ratio, heading)
    first, second = pair.exposed(seed)
    found: dict[str, float] = {}
    motions = {OURS: estimate_plane_motion(Template(first, window()), second)}
    motions |= {name: peer(first, second, window()) for name, peer in PEERS.items()}
    for name, motion in motions.items():
        plane = None if motion is None else measure_plane(motion, CAMERA, pair.motion)
        found[name] = float("inf") if plane is None else heading_of(plane.normal) - heading
        if name == OURS and plane is not None:
            found["distance"] = plane.distance * float(np.linalg.norm(pair.plane)) - 1
            right = np.array([-np.cos(np.radians(heading)), 0.0, 0.0])
            along = plane.distance * np.degrees(np.sqrt(right @ plane.covariance @ right))
            found["deviations"] = found[name] / float(along)
            found["disagreement"] = plane.disagreement
    return found


def score_changed(job: tuple[str, str, int, int]) -> dict[str, Contact]:
    """25 steps to contact, with something before the wall or in other light: texture, case, yaw, seed."""
    texture, case, yaw, seed = job
    part = dict(zip(cases()[:3], PARTS, strict=True)).get(case, 0.0)
    pair = approach_wall(texture, seed, 25, yaw, part, BEFORE if part else "")
    first, second = pair.exposed(seed, change=LIGHTS.get(case))
    found = {OURS: judge(estimate_plane_motion(Template(first, window()), second), pair)}
    for name in ("Farnebäck + 8 parameters", "DIS medium + 8 parameters"):
        found[name] = judge(PEERS[name](first, second, window()), pair)
    return found


def cases() -> list[str]:
    """What is changed in turn."""
    return [f"obstacle over {100 * part:.0f} %" for part in PARTS] + list(LIGHTS)


def cover(deviations: Iterable[float]) -> tuple[float, float]:
    """Per cent of the errors within 1 and 1.96 stated deviations."""
    off = np.abs(np.array([value for value in deviations if np.isfinite(value)]))
    return float(100 * np.mean(off < 1)), float(100 * np.mean(off < 1.96))


def median_percent(errors: Iterable[float]) -> float:
    """Of the absolute errors."""
    return 100 * float(np.median(np.abs(list(errors))))


def summarise_contact(scores: dict[tuple[int, int], list[dict[str, Contact]]]) -> dict[str, Any]:
    """Median and 95 % quantile of the error in per cent, by method, yaw and steps; coverage of ours."""
    table: dict[str, Any] = {}
    for (yaw, steps), pairs in scores.items():
        for name in pairs[0]:
            errors = [pair[name].error for pair in pairs]
            table.setdefault(name, {})[f"yaw {yaw}, {steps}"] = {
                "median_percent": round(median_percent(errors), 3),
                "p95_percent": round(100 * float(np.quantile(np.abs(errors), 0.95)), 3),
            }
    ours = [pair[OURS] for pairs in scores.values() for pair in pairs]
    table["cover_68_95"] = [round(part, 1) for part in cover(one.deviations for one in ours)]
    return table
