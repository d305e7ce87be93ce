"""The `[world]` table: which room, how its target moves, and the head's cameras in it."""

from typing import Annotated, Literal

import msgspec

from sim_devices.worlds.optics import Optics, Window
from sim_devices.worlds.plan import Mount

Positive = Annotated[float, msgspec.Meta(gt=0.0)]
NotNegative = Annotated[float, msgspec.Meta(ge=0.0)]
Part = Annotated[float, msgspec.Meta(ge=0.0, le=1.0)]
Triple = tuple[float, float, float]


class PathConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One coordinate of the target: degrees, or metres for the distance."""

    kind: Literal["still", "sine", "triangle", "ramp"] = "still"
    mean: float = 0.0
    amplitude: NotNegative = 0.0
    frequency_hz: NotNegative = 0.1
    speed: float = 5.0
    stop: float | None = None


class TargetConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What is followed: a lamp, a textured patch or pictures on a screen; azimuth positive left."""

    kind: Literal["lamp", "texture", "screen", "none"] = "lamp"
    size_m: Positive = 0.12
    walls: bool = True
    azimuth_deg: PathConfig = PathConfig(kind="sine", amplitude=15.0, frequency_hz=0.1)
    elevation_deg: PathConfig = PathConfig(kind="sine", amplitude=5.0, frequency_hz=0.07)
    distance_m: PathConfig = PathConfig(mean=1.2)
    pictures: str = ""
    picture_rate_hz: Positive = 6.0
    screen_deg: tuple[Positive, Positive] = (120.0, 90.0)


class SensorConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """What the electronics of a camera do to the light, as `sim_devices.camera.Sensor` has it."""

    rate_hz: Positive = 6.0
    exposure_ms: NotNegative = 0.0
    blur_samples: Annotated[int, msgspec.Meta(ge=1, le=64)] = 1
    gain: NotNegative = 1.0
    gain_drift: Annotated[float, msgspec.Meta(ge=-1.0, le=1.0)] = 0.0
    vignette: Annotated[float, msgspec.Meta(ge=0.0, lt=1.0)] = 0.0
    noise: NotNegative = 1.0
    latency_ms: NotNegative = 0.0
    drop: Part = 0.0


class CamerasConfig(SensorConfig, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Both cameras and how they sit on the head: offset forward, left, up; mount roll, pitch, yaw."""

    width: Annotated[int, msgspec.Meta(ge=8, le=4096)] = 128
    height: Annotated[int, msgspec.Meta(ge=8, le=4096)] = 128
    field_of_view_deg: Annotated[float, msgspec.Meta(gt=1.0, lt=150.0)] = 40.0
    baseline_m: Annotated[float, msgspec.Meta(ge=0.060, le=0.200)] = 0.130
    left_offset_m: Triple = (0.0, 0.0, 0.0)
    right_offset_m: Triple = (0.0, 0.0, 0.0)
    left_mount_deg: Triple = (0.0, 0.0, 0.0)
    right_mount_deg: Triple = (0.0, 0.0, 0.0)
    left_port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 0
    right_port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 0

    def port(self, side: str) -> int:
        """The TCP port one side is served on; 0 takes a free one."""
        return self.left_port if side == "left" else self.right_port


class CarriedCameraConfig(SensorConfig, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """One camera on a carrier. Its optical axis lies along the mount's x axis; ``window``: left, top, width, height.

    The errors are what a camera file that holds the rest does not know: the true focal length is
    ``focal_px`` (1 + ``focal_error``), the true angles and height are greater by theirs.
    """

    name: Annotated[str, msgspec.Meta(pattern="^[a-z0-9-]+$")]
    mount: Mount
    width: Annotated[int, msgspec.Meta(ge=8, le=4096)] = 256
    height: Annotated[int, msgspec.Meta(ge=8, le=4096)] = 256
    focal_px: Positive = 192.0
    window: tuple[int, int, int, int] | None = None
    focal_error: Annotated[float, msgspec.Meta(gt=-1.0, le=10.0)] = 0.0
    yaw_error_deg: float = 0.0
    pitch_error_deg: float = 0.0
    height_error: float = 0.0
    port: Annotated[int, msgspec.Meta(ge=0, le=65535)] = 0

    @property
    def part(self) -> Window | None:
        """The window that is read out; None reads the whole image."""
        return None if self.window is None else Window(*self.window)

    def __post_init__(self) -> None:
        if self.part is not None:
            self.optics.check(self.part)

    @property
    def optics(self) -> Optics:
        """The optics that the camera file tells of."""
        return self._optics(self.focal_px)

    @property
    def true_optics(self) -> Optics:
        """The optics that the camera has."""
        return self._optics(self.focal_px * (1.0 + self.focal_error))

    @property
    def true_mount(self) -> Mount:
        """Where the camera really sits."""
        return msgspec.structs.replace(
            self.mount,
            yaw_deg=self.mount.yaw_deg + self.yaw_error_deg,
            pitch_deg=self.mount.pitch_deg + self.pitch_error_deg,
            z=self.mount.z + self.height_error,
        )

    def _optics(self, focal: float) -> Optics:
        return Optics(self.width, self.height, focal, focal, (self.width - 1) / 2.0, (self.height - 1) / 2.0)


class WorldConfig(msgspec.Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """The head's surroundings and its cameras."""

    target: TargetConfig = TargetConfig()
    cameras: CamerasConfig = CamerasConfig()
    light: NotNegative = 1.0
    seed: Annotated[int, msgspec.Meta(ge=0)] = 0
