"""The target of a gaze: the bright spot of thesis 6.5.1, found by threshold and centre of mass."""

import math
from dataclasses import dataclass

import cv2
import numpy as np
from numpy.typing import NDArray

Image = NDArray[np.uint8]


@dataclass(frozen=True)
class Target:
    """Where a target is in an image: pixel centres at whole numbers, x right, y down, origin at the first pixel."""

    x_px: float
    y_px: float
    """Its centre."""
    area_px: float
    """Its area, in pixels of the image it was found in."""
    confidence: float
    """0 to 1."""
    sigma_px: float
    """Standard deviation of either coordinate."""


@dataclass(frozen=True)
class Shape:
    """What a component must be like to be taken for the target; None sets no limit.

    Raises:
        ValueError: the largest area is under the least.
    """

    least_area_px: float = 1.0
    largest_area_px: float | None = None
    least_roundness: float | None = None
    """Of area/(4π √det M), M the second central moments: 1 for every filled ellipse, however flat, less for anything
    else."""
    least_flatness: float | None = None
    """Of the ratio of the ellipse's minor to its major axis."""

    def __post_init__(self) -> None:
        if self.largest_area_px is not None and self.largest_area_px < self.least_area_px:
            raise ValueError(
                f"largest area {self.largest_area_px} px is under the least, {self.least_area_px} px"
            )


def subsample(image: Image, size: int = 64) -> Image:
    """Subsample an image by averaging whole blocks of pixels (thesis 6.5.1: 512² to 64²).

    Averaging, where the thesis takes every eighth pixel: a target smaller than the step is then never missed.

    Args:
        image: grey, height × width.
        size: columns of the result; an image of fewer than twice as many is returned as it is.
    """
    step = image.shape[1] // size
    if step <= 1:
        return image
    height = image.shape[0] // step
    return np.asarray(
        cv2.resize(image[: height * step, : size * step], (size, height), interpolation=cv2.INTER_AREA),
        np.uint8,
    )


def detect_bright_target(
    image: Image, threshold: int, *, size: int = 64, shape: Shape | None = None
) -> Target | None:
    """The bright target of an image, in pixels of that image; None when there is none (thesis 6.5.1).

    Without a shape it is the centre of mass of everything over the threshold, as in the thesis; with one, of
    the component that fits the shape best (the roundest, then the largest). Each pixel weighs what it exceeds
    the threshold by, so a spot of few pixels is placed to a fraction of one.

    Args:
        image: grey, height × width.
        threshold: 0 to 254 grey levels.
        size: columns to which the image is subsampled first.
        shape: in pixels of the subsampled image.

    Raises:
        ValueError: the image is not grey or the threshold outside its range.
    """
    if image.ndim != 2:
        raise ValueError(f"a grey image (H, W) is needed, this one has shape {image.shape}")
    if not 0 <= threshold <= 254:
        raise ValueError(f"a threshold is 0 to 254 grey levels, not {threshold}")
    small = subsample(image, size)
    step = image.shape[1] / small.shape[1] if small is not image else 1.0
    weight = np.where(small > threshold, small - np.uint8(threshold), np.uint8(0))
    if shape is None:
        moments = cv2.moments(weight)
        area = float(cv2.countNonZero(weight))
        roundness = 1.0
    else:
        found = _best_component(weight, shape)
        if found is None:
            return None
        moments, area, roundness = found
    if moments["m00"] <= 0:
        return None
    x, y = moments["m10"] / moments["m00"], moments["m01"] / moments["m00"]
    # A disc of n pixels whose rim is uncertain by some 0.3 px: the centre's error falls with the length of
    # the rim.
    sigma = 0.3 * step / math.sqrt(max(1.0, math.sqrt(4 * math.pi * area)))
    return Target(
        (x + 0.5) * step - 0.5,
        (y + 0.5) * step - 0.5,
        area * step * step,
        float(min(1.0, roundness) * (1 - math.exp(-area / 2))),
        sigma,
    )


def _best_component(weight: Image, shape: Shape) -> tuple[dict[str, float], float, float] | None:
    """Moments, area and roundness of the component that fits the shape best."""
    count, labels, stats, _ = cv2.connectedComponentsWithStats((weight > 0).astype(np.uint8), connectivity=8)
    best: tuple[dict[str, float], float, float] | None = None
    for label in range(1, count):
        left, top, width, height, area = (int(v) for v in stats[label])
        if area < shape.least_area_px or (shape.largest_area_px is not None and area > shape.largest_area_px):
            continue
        window = (slice(top, top + height), slice(left, left + width))
        mask = labels[window] == label
        roundness, flatness = _ellipse_likeness(mask)
        if shape.least_roundness is not None and roundness < shape.least_roundness:
            continue
        if shape.least_flatness is not None and flatness < shape.least_flatness:
            continue
        if best is None or (round(roundness, 2), area) > (round(best[2], 2), best[1]):
            moments = dict(cv2.moments(np.where(mask, weight[window], 0).astype(np.uint8)))
            moments["m10"] += left * moments["m00"]
            moments["m01"] += top * moments["m00"]
            best = moments, float(area), roundness
    return best


def _ellipse_likeness(mask: NDArray[np.bool_]) -> tuple[float, float]:
    """Roundness (1 for a filled ellipse) and flatness (minor over major axis) of a mask (H, W)."""
    moments = cv2.moments(mask.astype(np.uint8), binaryImage=True)
    area = moments["m00"]
    # A pixel is a unit square, not a point: its own second moment is 1/12.
    xx, yy, xy = moments["mu20"] / area + 1 / 12, moments["mu02"] / area + 1 / 12, moments["mu11"] / area
    mean, spread = (xx + yy) / 2, math.hypot((xx - yy) / 2, xy)
    return area / (4 * math.pi * math.sqrt(xx * yy - xy * xy)), math.sqrt((mean - spread) / (mean + spread))
