"""A sequence run from files to files: what the command line does."""

import csv
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.camera.intrinsics import Intrinsics
from perception.camera.motion import Motion
from perception.depth.errors import ImageError, MotionError, OptionError
from perception.depth.estimator import DepthFromMotion, DepthMap
from perception.depth.files.depth_image import colour_depth
from perception.depth.files.lens import pinhole, read_lens, undistort
from perception.depth.files.motion_file import read_poses
from perception.depth.files.point_cloud import write_ply
from perception.depth.files.reference import read_reference
from perception.depth.files.sequence import list_images, read_image
from perception.depth.geometry.pinhole import Pinhole
from perception.depth.program.accuracy import Accuracy, compare
from perception.depth.program.plausibility import check_motion, explain_no_parallax, find_implausibility
from perception.depth.settings import PRESETS, DepthSettings

Matrix = NDArray[np.float64]
MOTION_NAMES = ("motion.csv", "groundtruth.txt", "poses.txt")


@dataclass(frozen=True)
class RunOptions:
    """The options of a run; images are counted from 1."""

    sequence: Path
    out: Path
    camera: Path | None = None
    motion: Path | None = None
    motion_format: str = "auto"
    preset: str = "default"
    near: float | None = None
    far: float | None = None
    start_depth: float | None = None
    order: tuple[int, ...] | None = None
    reference_frame: int | None = None
    reference: Path | None = None
    reference_scale: float = 1.0
    reference_baseline: float | None = None


@dataclass(frozen=True)
class TableRow:
    """One image's row; the fields are the columns of table.csv and the keys of the JSON document.

    `stray_px` is the epipolar residual.
    """

    picture: str
    baseline_m: float
    rotation_deg: float
    stray_px: float
    confirmed: float
    known: float
    median_depth_m: float
    median_relative_std: float
    seconds: float
    accuracy: Accuracy | None
    remark: str | None


@dataclass(frozen=True)
class Plan:
    """Images and motions in the order in which they are used; the motions lead from `kept` to each."""

    images: list[Path]
    motions: list[Motion]
    anchored: bool


def settings_of(options: RunOptions) -> DepthSettings:
    """The preset with what was changed of it.

    Raises:
        OptionError: there is no such preset, or near and far are no range.
    """
    if options.preset not in PRESETS:
        raise OptionError(f"no preset {options.preset!r}; there is {', '.join(PRESETS)}")
    changes = {name: getattr(options, name) for name in ("near", "far", "start_depth")}
    return replace(
        PRESETS[options.preset], **{name: value for name, value in changes.items() if value is not None}
    )


def make_plan(options: RunOptions) -> Plan:
    """Find images and motion and bring them into order.

    Raises:
        ImageError, MotionError, OptionError: what is missing or wrong.
    """
    images = [path for path in list_images(options.sequence) if path != options.reference]
    folder = options.sequence if options.sequence.is_dir() else options.sequence.parent
    motion = options.motion or next(
        (folder / name for name in MOTION_NAMES if (folder / name).is_file()), None
    )
    if motion is None:
        raise MotionError(f"{folder}: no motion given, and none of {', '.join(MOTION_NAMES)} is there")
    poses = read_poses(motion, images, options.motion_format)
    order = list(options.order or range(1, len(images) + 1))
    frame = options.reference_frame
    for number in (*order, *(() if frame is None else (frame,))):
        if not 1 <= number <= len(images):
            raise OptionError(f"image {number}: there are 1 to {len(images)}")
    if len(order) < 2 or len(set(order)) != len(order):
        raise OptionError("the order must name two or more different images")
    if frame is not None:
        order = [frame, *(number for number in order if number != frame)]
    chosen = [number - 1 for number in order]
    kept = [chosen[0]] * (len(chosen) - 1) if frame is not None else chosen[:-1]
    motions = [Motion.between(poses[a], poses[b]) for a, b in zip(kept, chosen[1:], strict=True)]
    return Plan([images[i] for i in chosen], motions, frame is not None)


def find_lens(options: RunOptions, shape: tuple[int, int], warn: Callable[[str], None]) -> Intrinsics:
    """The lens of the camera file that was given or lies beside the images; else a guess, with a warning."""
    folder = options.sequence if options.sequence.is_dir() else options.sequence.parent
    path = options.camera or (folder / "camera.toml" if (folder / "camera.toml").is_file() else None)
    height, width = shape
    if path is not None:
        return read_lens(path, (width, height))
    guess = Pinhole.guess(width, height)
    warn(f"no camera given: a lens of 60° is assumed (fx = fy = {guess.fx:.0f} px)")
    return Intrinsics(width, height, guess.fx, guess.fy, guess.cx, guess.cy)


def run(options: RunOptions, warn: Callable[[str], None]) -> Iterator[TableRow]:
    """Run the sequence, write its files, and give a row after every image but the first.

    Raises:
        DepthError: the first thing that is wrong, in one line.
    """
    settings, plan = settings_of(options), make_plan(options)
    first = read_image(plan.images[0])
    shape = (first.shape[0], first.shape[1])
    lens = find_lens(options, shape, warn)
    camera, first = pinhole(lens), undistort(lens, first)
    pixels_per_inverse_metre = (
        None if options.reference_baseline is None else camera.fx * options.reference_baseline
    )
    truth = (
        None
        if options.reference is None
        else read_reference(options.reference, options.reference_scale, pixels_per_inverse_metre)
    )
    for name, kept, motion in zip(
        plan.images[1:],
        [plan.images[0]] * len(plan.motions) if plan.anchored else plan.images,
        plan.motions,
        strict=False,
    ):
        check_motion(camera, motion, shape, settings, (kept.name, name.name))
    options.out.mkdir(parents=True, exist_ok=True)
    estimator = DepthFromMotion(camera, settings, plan.anchored)
    estimator.start(first)
    rows, image, result = [], first, None
    for path, motion in zip(plan.images[1:], plan.motions, strict=True):
        newest = undistort(lens, read_image(path))
        begun = time.perf_counter()
        try:
            result = estimator.step(newest, motion)
        except ImageError as error:
            raise ImageError(f"{path}: {error}") from error
        seconds = time.perf_counter() - begun
        image = first if plan.anchored else newest
        remark = (
            find_implausibility(result, settings)
            if result.measured
            else explain_no_parallax(camera, motion, shape, settings)
        )
        last = path == plan.images[-1]
        accuracy = None
        if truth is not None and (plan.anchored or last):
            accuracy = _compare(result, truth, pixels_per_inverse_metre, options)
        row = _row(path.name, motion, result, seconds, accuracy, remark)
        rows.append(row)
        _write_map(options.out, path.stem, result)
        yield row
    if result is None or not any(np.isfinite(row.median_depth_m) for row in rows):
        raise MotionError(f"no depth at all: {rows[-1].remark or 'nothing could be matched'}")
    write_ply(options.out / "cloud.ply", camera, result.state, image)
    _write_table(options.out / "table.csv", rows)


def _compare(
    result: DepthMap, truth: NDArray[np.float32], pixels_per_inverse_metre: float | None, options: RunOptions
) -> Accuracy:
    try:
        return compare(result.state, truth, pixels_per_inverse_metre)
    except ValueError as error:
        raise OptionError(f"{options.reference}: {error}") from error


def _row(
    name: str, motion: Motion, result: DepthMap, seconds: float, accuracy: Accuracy | None, remark: str | None
) -> TableRow:
    value, variance = result.state.value, result.state.variance
    known = np.isfinite(value) & (value > 0)
    nan = float("nan")
    return TableRow(
        name,
        motion.distance,
        float(np.degrees(motion.angle)),
        result.residual_px,
        result.confirmed,
        float(known.mean()),
        float(1 / np.median(value[known])) if known.any() else nan,
        float(np.median(np.sqrt(variance[known]) / value[known])) if known.any() else nan,
        seconds,
        accuracy,
        remark,
    )


def _write_map(folder: Path, stem: str, result: DepthMap) -> None:
    try:
        np.save(folder / f"{stem}-depth.npy", result.depth)
        np.save(folder / f"{stem}-std.npy", result.depth_std)
        if not cv2.imwrite(str(folder / f"{stem}-depth.png"), colour_depth(result.depth)):
            raise OSError(None, "the picture could not be encoded or stored")
    except OSError as error:
        raise OptionError(f"{folder}: cannot be written ({error.strerror or error})") from error


def _write_table(path: Path, rows: list[TableRow]) -> None:
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        plain = [name for name in TableRow.__dataclass_fields__ if name != "accuracy"]
        judged = list(Accuracy.__dataclass_fields__)
        writer.writerow(plain + judged)
        for row in rows:
            figures = [getattr(row.accuracy, name) for name in judged] if row.accuracy else [""] * len(judged)
            writer.writerow(
                [getattr(row, name) if getattr(row, name) is not None else "" for name in plain] + figures
            )
