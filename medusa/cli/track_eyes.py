"""The two eyes of a tracking run: emulated cameras in a rendered room, or real ones with their calibration."""

import tomllib
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import cv2
import numpy as np

from medusa.calibration.head_geometry import turn_matrix
from medusa.errors import CommandError
from medusa.gaze.retina import Detector, Retina
from medusa.gaze.run.assembly import bright_detectors, patch_detectors
from medusa.kinematics import HeadGeometry, Vector
from perception.camera import CaptureSettings, open_camera
from perception.camera.intrinsics import Intrinsics, load_intrinsics
from perception.camera.slot import SlotCamera
from perception.target import Shape

if TYPE_CHECKING:
    from medusa.simulation import SimulatedHead


@dataclass(frozen=True)
class Eyes:
    """Cameras, lenses, geometry and detectors of both eyes."""

    cameras: tuple[SlotCamera, SlotCamera]
    intrinsics: tuple[Intrinsics, Intrinsics]
    geometry: HeadGeometry
    detectors: tuple[Detector, Detector]
    turns: tuple[Vector, Vector] | None = None
    by_disparity: bool = False

    def retina(self) -> Retina:
        """What turns pairs of pictures into sightings."""
        return Retina(*self.intrinsics, *self.detectors, turns=self.turns, by_disparity=self.by_disparity)


def simulated_world(settings: Mapping[str, Any]) -> Any:
    """The emulated surroundings that the command line asks for; raises CommandError."""
    from medusa.simulation import simulated_surroundings

    if settings["left"] or settings["right"] or settings["cameras"]:
        raise CommandError("--sim brings its own cameras: leave --left, --right and --cameras out")
    if settings["target"] not in ("lamp", "texture"):
        raise CommandError(f"there is no emulated target {settings['target']!r}; there is lamp, texture")
    return simulated_surroundings(
        target=settings["target"], screen=settings["screen"], pixels=settings["pixels"], rate=settings["rate"],
        latency_ms=settings["latency"],
    )  # fmt: skip


@asynccontextmanager
async def simulated_eyes(simulated: "SimulatedHead", settings: Mapping[str, Any]) -> AsyncIterator[Eyes]:
    """Both emulated eyes; as a perfect calibration would describe them."""
    lens = simulated.intrinsics()
    if settings["patch"] or settings["target"] == "texture":
        patch = _read_patch(settings["patch"]) if settings["patch"] else simulated.target_patch()
        detectors = patch_detectors(patch)
    elif settings["screen"]:
        # The disc is some 0.15 of the picture's width; the background's bright parts are larger or ragged.
        size = min(lens.width, 128)
        area = float(settings["least_area"]) or 0.02 * lens.width**2
        # A rectangle is 3/π = 0.955 round, an ellipse 1.
        round_enough = settings["roundness"] or 0.97
        shape = Shape(area * (size / lens.width) ** 2, 0.3 * size**2, round_enough, 0.4)
        detectors = bright_detectors(settings["threshold"], size=size, shape=shape)
    else:
        detectors = bright_detectors(settings["threshold"], shape=_shape(settings))
    async with simulated.cameras() as cameras:
        yield Eyes(
            cameras,
            (lens, lens),
            simulated.geometry(),
            detectors,
            by_disparity=settings["vergence"] == "disparity",
        )


@asynccontextmanager
async def real_eyes(settings: Mapping[str, Any]) -> AsyncIterator[Eyes]:
    """Two cameras with the calibration that `medusa-ctl calibrate` wrote; raises CommandError, CameraError."""
    if settings["screen"]:
        raise CommandError("--screen needs --sim: real pictures are shown in the emulated room")
    for key in ("left", "right", "cameras"):
        if not settings[key]:
            raise CommandError(f"--{key} is needed without --sim")
    path = Path(settings["cameras"])
    lenses = load_intrinsics(path, "left"), load_intrinsics(path, "right")
    geometry, turns = _load_geometry(path)
    capture = _capture_settings(path, float(settings["rate"]))
    detectors = (
        patch_detectors(_read_patch(settings["patch"]))
        if settings["patch"]
        else bright_detectors(settings["threshold"], shape=_shape(settings))
    )
    left = open_camera(settings["left"], capture, name="left")
    right = open_camera(settings["right"], capture, name="right")
    async with left, right:
        yield Eyes((left, right), lenses, geometry, detectors, turns, settings["vergence"] == "disparity")


def _shape(settings: Mapping[str, Any]) -> Shape | None:
    if not settings["least_area"] and not settings["roundness"]:
        return None
    return Shape(settings["least_area"] or 1.0, None, settings["roundness"] or None)


def _read_patch(path: str) -> Any:
    try:
        picture = cv2.imdecode(np.fromfile(path, np.uint8), cv2.IMREAD_GRAYSCALE)
    except (OSError, cv2.error):
        picture = None
    if picture is None:
        raise CommandError(f"{path}: cannot be read as a picture")
    return picture


def _load_geometry(path: Path) -> tuple[HeadGeometry, tuple[Vector, Vector]]:
    """Baseline, optical centres and turns from the table [head]; raises CommandError naming file and key."""
    table = tomllib.loads(path.read_text(encoding="utf-8")).get("head")
    if not isinstance(table, dict) or not isinstance(table.get("baseline_m"), float):
        raise CommandError(f"{path}: [head] baseline_m is missing; `medusa-ctl calibrate --head` writes it")
    left, right, left_turn, right_turn = (
        _triple(path, table, key)
        for key in ("left_centre_m", "right_centre_m", "left_turn_rad", "right_turn_rad")
    )
    return HeadGeometry(table["baseline_m"], left, right), (turn_matrix(left_turn), turn_matrix(right_turn))


def _capture_settings(path: Path, rate: float) -> CaptureSettings:
    """What the table [capture] asks of both cameras; raises CommandError naming file and key."""
    table = tomllib.loads(path.read_text(encoding="utf-8")).get("capture", {})
    kinds: dict[str, type | tuple[type, ...]] = {
        "width": int, "height": int, "pixel_format": str,
        "exposure": (int, float), "gain": (int, float), "delay": (int, float),
    }  # fmt: skip
    for key, value in table.items():
        if key not in kinds:
            raise CommandError(f"{path}: [capture] knows {', '.join(kinds)}, not {key!r}")
        if not isinstance(value, kinds[key]) or isinstance(value, bool):
            raise CommandError(f"{path}: [capture] {key} = {value!r} is of the wrong kind")
        if key == "pixel_format" and len(str(value)) != 4:
            raise CommandError(f"{path}: [capture] pixel_format {value!r} must have four letters")
    return CaptureSettings(rate=rate, **table)


def _triple(path: Path, table: Mapping[str, Any], key: str) -> tuple[float, float, float]:
    values = table.get(key, [0.0, 0.0, 0.0])
    if not (isinstance(values, list) and len(values) == 3 and all(isinstance(v, float) for v in values)):
        raise CommandError(f"{path}: [head] {key} must be three decimal numbers, not {values!r}")
    return values[0], values[1], values[2]
