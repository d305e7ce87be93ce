"""PID against predictive pursuit: sines and triangle waves of ±25°, three frame rates, one latency."""

import math
from dataclasses import dataclass
from typing import Any, Literal

from medusa.gaze.coordination import EyesFirst
from medusa.gaze.pid import TABLE_6_4
from medusa.gaze.predictive_gaze import PredictiveGaze, PredictiveSettings
from medusa.gaze.run.loop import LoopSettings
from medusa.gaze.thesis_gaze import ThesisGaze, ThesisSettings
from medusa.kinematics import HeadGeometry
from sim_devices.worlds.config import CamerasConfig, PathConfig, TargetConfig, WorldConfig
from tools.gaze.rig import Rig, open_rig
from tools.gaze.single_axis import spot_in

Wave = Literal["sine", "triangle"]
RATES_HZ = (1.5, 6.0, 25.0)
SPEEDS_DEG_S = (1.0, 2.0, 5.0, 10.0, 20.0, 40.0, 60.0)
AMPLITUDE_DEG = 25.0
LATENCY = 0.06
COMMAND_PERIOD = 0.02
LARGEST_STEP_DEG = 8.0
SACCADE_ERROR_DEG = 10.0
# Eyes alone: the neck would hide differences between the controllers behind its own saccades.
EYES_ONLY = EyesFirst(comfort=math.radians(80.0))


@dataclass(frozen=True)
class Case:
    """A wave, its peak speed in degrees a second and the frame rate."""

    wave: Wave
    speed_deg_s: float
    rate_hz: float
    amplitude_deg: float = AMPLITUDE_DEG

    @property
    def compared(self) -> bool:
        """Whether the target moves at most 8° from picture to picture; elsewhere both may lose it."""
        return self.speed_deg_s / self.rate_hz <= LARGEST_STEP_DEG + 1e-9

    @property
    def path(self) -> PathConfig:
        """The azimuth; a sine has its peak speed at the middle."""
        if self.wave == "triangle":
            return PathConfig(kind="triangle", amplitude=self.amplitude_deg, speed=self.speed_deg_s)
        frequency = self.speed_deg_s / (2.0 * math.pi * self.amplitude_deg)
        return PathConfig(kind="sine", amplitude=self.amplitude_deg, frequency_hz=frequency)

    @property
    def period(self) -> float:
        """Seconds of one wave."""
        if self.wave == "triangle":
            return 4.0 * self.amplitude_deg / self.speed_deg_s
        return 1.0 / self.path.frequency_hz

    @property
    def settled(self) -> float:
        """Seconds after which errors count: six pictures and a second."""
        return 1.0 + 6.0 / self.rate_hz

    @property
    def seconds(self) -> float:
        """Long enough for a wave and a half, but between 8 and 20 s after settling."""
        return self.settled + min(max(1.5 * self.period, 8.0), 20.0)


def surroundings(azimuth: PathConfig, rate_hz: float, *, latency: float = LATENCY) -> WorldConfig:
    """A lamp 1.5 m away on a dark sky, 64² pixels and 40°."""
    lamp = TargetConfig(
        kind="lamp", size_m=0.08, azimuth_deg=azimuth, elevation_deg=PathConfig(),
        distance_m=PathConfig(mean=1.5), walls=False,
    )  # fmt: skip
    cameras = CamerasConfig(
        width=64, height=64, field_of_view_deg=40.0, rate_hz=rate_hz, noise=1.0, latency_ms=1e3 * latency
    )
    return WorldConfig(target=lamp, cameras=cameras)


def thesis_gaze(name: str, rate_hz: float) -> Any:
    """A maker of the thesis's controller with one column of table 6.4."""

    def make(rig: Rig, _: HeadGeometry) -> ThesisGaze:
        settings = ThesisSettings(
            1.0 / rate_hz, rig.least_speeds, TABLE_6_4[name], math.radians(SACCADE_ERROR_DEG), EYES_ONLY
        )
        return ThesisGaze(settings, rig.limits)

    return make


def predictive_gaze(rate_hz: float, **changes: Any) -> Any:
    """A maker of the predictive controller; it waits for at least two and a half pictures."""

    def make(rig: Rig, geometry: HeadGeometry) -> PredictiveGaze:
        settings = PredictiveSettings(
            **{
                "command_period": COMMAND_PERIOD, "coordination": EYES_ONLY,
                "patience": max(0.5, 2.5 / rate_hz), **changes,
            }
        )  # fmt: skip
        return PredictiveGaze(settings, geometry, rig.limits)

    return make


def loop_settings(rate_hz: float) -> LoopSettings:
    """A look every 20 ms; pictures older than two periods say nothing."""
    return LoopSettings(command_period=COMMAND_PERIOD, too_late=max(0.6, 2.0 / rate_hz))


async def run_case(rig: Rig, case: Case, controllers: tuple[str, ...]) -> dict[str, Any]:
    """Figures of each controller ("predictive" or a column of table 6.4) on one case."""
    row: dict[str, Any] = {
        "wave": case.wave, "speed_deg_s": case.speed_deg_s, "rate_hz": case.rate_hz,
        "amplitude_deg": case.amplitude_deg, "compared": case.compared,
    }  # fmt: skip
    for name in controllers:
        make = predictive_gaze(case.rate_hz) if name == "predictive" else thesis_gaze(name, case.rate_hz)
        run = await rig.run(
            surroundings(case.path, case.rate_hz), make, case.seconds,
            detectors=(spot_in, spot_in), settings=loop_settings(case.rate_hz),
        )  # fmt: skip
        row[name] = run.figures(case.settled)
    pids = [row[name]["rms_deg"] for name in controllers if name != "predictive" and not row[name]["lost"]]
    row["best_pid_rms_deg"] = min(pids) if pids else None
    return row


async def sweep(
    cases: list[Case], controllers: tuple[str, ...] = ("predictive", *TABLE_6_4)
) -> list[dict[str, Any]]:
    """All cases on one head."""
    async with open_rig() as rig:
        return [await run_case(rig, case, controllers) for case in cases]


def all_cases() -> list[Case]:
    """Every wave, rate and speed, and the 15°, 0.2 Hz sine at 6 Hz first."""
    first = Case("sine", 15.0 * 2.0 * math.pi * 0.2, 6.0, amplitude_deg=15.0)
    waves: tuple[Wave, Wave] = ("sine", "triangle")
    return [first, *(Case(wave, v, rate) for wave in waves for rate in RATES_HZ for v in SPEEDS_DEG_S)]
