"""Steps, velocities and profiles through the drivers, recorded at every sample, each with its prediction.

The prediction is the design's own quantised loop on the thesis's plant. It starts where the recording starts: from
the shaft's true place between two counts, so that what is left to differ is the emulator's working, not its state.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import AsyncIterator, Callable, Coroutine
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from medusa.head.joint_group import JointGroup
from medusa.mc3000.board import Mode
from medusa.mc3000.config import FilterConfig, Filters, Mc3000Config
from medusa.mc3000.drive import Mc3000Drive
from medusa.servo.loop import LoopRecord, simulate_position, simulate_proportional_velocity
from medusa.servo.plant import Plant
from medusa.servo.position_filter import FilterRegisters
from medusa.servo.response import StepFigures, step_figures
from medusa.servo.thesis import AXES
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices.head_config import HeadConfig as MachineConfig

STEPS = (100, 1000, 10_000)
FOLLOWING_DEG = 60.0
"""A step of 10 000 counts is one following error: the trip has to be wider than that."""
REST_SAMPLES = 12
"""Samples before the motion that the prediction runs through, too."""
EDGE = 1e-3
"""Counts above the edge itself, which rounding would miss."""
NEAR_SENSORS = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}

Floats = NDArray[np.float64]


@dataclass(frozen=True)
class Run:
    """One motion at every sample from its start: time s, positions in counts from where the shaft was."""

    name: str
    axis: str
    time: Floats
    command: Floats
    counts: Floats
    shaft: Floats
    """True joint, in counts: behind the backlash where there is one."""
    dac: Floats
    predicted: Floats
    """Motor shaft that the design predicts, with the friction that the machine has."""
    predicted_counts: Floats
    period: float

    @property
    def error(self) -> Floats:
        """Command minus encoder, counts."""
        return self.command - self.counts

    @property
    def prediction_error(self) -> float:
        """Greatest distance between what the encoder shows and what was predicted, counts."""
        return float(np.abs(self.counts - self.predicted_counts).max())

    def step(self) -> StepFigures:
        """Figures of the shaft's response to the last command."""
        return step_figures(self.time, self.shaft, float(self.command[-1]))

    @property
    def final_error_counts(self) -> int:
        """Command minus encoder at the end, counts."""
        return int(self.command[-1] - self.counts[-1])

    @property
    def overshoot_counts(self) -> int:
        """The encoder's way beyond the last command, counts."""
        sign = 1 if self.command[-1] >= 0 else -1
        return max(0, int(((self.counts - self.command[-1]) * sign).max()))


@asynccontextmanager
async def homed_head(
    *,
    friction: float = 0.0,
    backlash_deg: float = 0.0,
    seed: int = 1,
    filters: dict[str, FilterRegisters] | None = None,
    limits: dict[str, dict[str, float]] | None = None,
) -> AsyncIterator[tuple[SimulatedHead, JointGroup]]:
    """An emulated head, homed, with a wide following limit; other position filters and keys where given."""
    machine = MachineConfig(friction_counts=friction, backlash_deg=backlash_deg, start_deg=NEAR_SENSORS)
    async with (
        simulated_head(seed=seed, config=machine) as sim,
        sim.open(with_filters(sim.config, filters or {}, limits or {})) as head,
    ):
        await head.home()
        yield sim, head


def with_filters(
    config: Mc3000Config, filters: dict[str, FilterRegisters], limits: dict[str, dict[str, float]]
) -> Mc3000Config:
    """The configuration with a wide following limit, other position filters and other keys, by axis."""
    for name in AXES:
        axis = config.axes[name]
        chosen: dict[str, Any] = {"following_limit_deg": FOLLOWING_DEG, **limits.get(name, {})}
        if name in filters:
            r = filters[name]
            position = FilterConfig(A=r.zero, B=r.pole, K=r.gain, T=r.timer)
            velocity = axis.filters.proportional_velocity
            chosen["filters"] = Filters(
                position=position, integral_velocity=position, proportional_velocity=velocity
            )
        config = config.with_axis(name, **chosen)
    return config


class Bench:
    """One joint of a homed head: puts it somewhere and records what it then does."""

    def __init__(self, sim: SimulatedHead, head: JointGroup, name: str) -> None:
        self.sim, self.head, self.name = sim, head, name
        self.axis = Mc3000Drive.of(head).axes[name]
        self.scale = self.axis.counts_per_radian
        self.plant: Plant = AXES[name].plant
        self.friction: float = sim.machine.config.friction_counts

    def registers(self, mode: Mode) -> FilterRegisters:
        """Bytes of a mode as configured."""
        f = self.axis.config.filters.of(mode)
        return FilterRegisters(f.A, f.B, f.K, f.T)

    async def place(self, degrees: float) -> None:
        """Move there and stand, the command where the shaft rests: a step then starts without an error."""
        await self.axis.set_mode(Mode.POSITION)
        await self.head.move({self.name: math.radians(degrees)})
        await self.axis.set_mode(Mode.IDLE)
        await self.head.rest([self.name])
        await asyncio.sleep(0.3)
        await self.axis.set_mode(Mode.POSITION)

    async def place_on_edge(self, degrees: float) -> None:
        """The same, and the shaft then where the equations page starts: on the lower edge of its encoder count."""
        await self.place(degrees)
        await self.axis.set_mode(Mode.IDLE)
        shaft = self.sim.machine.joint_angles(asyncio.get_running_loop().time())[self.name] * self.scale
        self.sim.machine.verbs["place"](axis=self.name, angle=(math.floor(shaft) + EDGE) / self.scale)
        await self.axis.set_mode(Mode.POSITION)

    async def _record(self, seconds: float, act: Callable[[], Coroutine[Any, Any, Any]]) -> dict[str, Floats]:
        with self.sim.machine.record(self.name) as recording:
            await asyncio.sleep(0.05)
            await act()
            await asyncio.sleep(seconds)
        return {
            "time": np.array(recording.time),
            "command": np.array(recording.command, dtype=np.float64),
            "counts": np.array(recording.actual, dtype=np.float64),
            "shaft": np.array(recording.angle) * self.scale,
            "dac": np.array(recording.motor_command, dtype=np.float64),
        }

    def _cut(
        self, raw: dict[str, Floats], start: int, predicted: LoopRecord, name: str, origin: float
    ) -> Run:
        """The run from sample `start`; positions from `origin`, the command at rest, shafts from their own."""
        part = {key: values[start:] for key, values in raw.items()}
        first = float(part["shaft"][0])
        samples = len(part["time"])
        return Run(
            name=name,
            axis=self.name,
            time=part["time"] - part["time"][0],
            command=part["command"] - origin,
            counts=part["counts"] - origin,
            shaft=part["shaft"] - first,
            dac=part["dac"],
            predicted=predicted.shaft[-samples:] - predicted.shaft[-samples],
            predicted_counts=predicted.counts[-samples:].astype(np.float64) - origin,
            period=self.axis.sample_period(self.axis.mode),
        )

    async def step(self, counts: int, seconds: float = 0.4) -> Run:
        """Step the command position by `counts` and hold."""
        before = (await self.head.read()).joints[self.name].device.command
        # A step ends where the command goes; the shaft's way is counted from the command, too, as the page does.
        raw = await self._record(seconds, lambda: self.axis.step((before + counts) / self.scale))
        start = int(np.argmax(raw["command"] != raw["command"][0]))
        predicted = self._predict(raw, start)
        return self._cut(raw, start, predicted, f"{counts} counts", float(before))

    def _predict(self, raw: dict[str, Floats], start: int) -> LoopRecord:
        """The quantised loop on the recorded command, from rest some samples before the motion."""
        first = max(start - REST_SAMPLES, 0)
        last = max(first - 1, 0)
        commands = raw["command"][first:].astype(np.int64)
        return simulate_position(
            self.plant,
            self.registers(Mode.POSITION),
            commands,
            friction=self.friction,
            start=_place(raw, first),
            before=(int(raw["command"][last] - raw["counts"][last]), int(raw["dac"][last])),
        )

    async def profile(self, degrees: float, seconds: float = 0.3) -> Run:
        """A profile with the configured speed and acceleration from where it stands by `degrees`."""
        before = (await self.head.read()).joints[self.name].device.command
        target = before / self.scale + math.radians(degrees)
        raw = await self._record(seconds, lambda: self.head.move({self.name: target}))
        start = max(int(np.argmax(raw["command"] != raw["command"][0])) - 1, 0)
        return self._cut(raw, start, self._predict(raw, start), f"{degrees:g}° profile", float(before))

    async def integral_velocity(self, degrees_s: float, seconds: float = 1.2) -> Run:
        """A velocity step in integral velocity mode."""
        await self.axis.set_mode(Mode.INTEGRAL_VELOCITY)
        before = (await self.head.read()).joints[self.name].device.command
        raw = await self._record(seconds, lambda: self.axis.set_rate(math.radians(degrees_s)))
        start = max(int(np.argmax(raw["command"] != raw["command"][0])) - 1, 0)
        run = self._cut(raw, start, self._predict(raw, start), f"integral {degrees_s:g}°/s", float(before))
        await self._halt()
        return run

    async def proportional_velocity(self, degrees_s: float, seconds: float = 0.5) -> Run:
        """A velocity step in proportional velocity mode; the command is the integral of the velocity."""
        await self.axis.set_mode(Mode.PROPORTIONAL_VELOCITY)
        registers = self.registers(Mode.PROPORTIONAL_VELOCITY)
        raw = await self._record(seconds, lambda: self.axis.set_rate(math.radians(degrees_s)))
        velocity = round(math.radians(degrees_s) * self.scale * registers.period * 16)
        # The chip answers a new velocity at once by (K/4) times it; what it gives at rest is far less.
        first_dac = min(127, abs(registers.gain / 4 * velocity / 16))
        start = int(np.argmax(np.abs(raw["dac"]) >= 0.7 * first_dac))
        origin = float(raw["counts"][start])
        samples = len(raw["time"]) - start
        predicted = simulate_proportional_velocity(
            self.plant,
            registers.gain,
            [velocity] * samples,
            registers.period,
            friction=self.friction,
            start=_place(raw, start),
        )
        raw["command"] = np.concatenate([np.full(start, origin), origin + velocity / 16 * np.arange(samples)])
        run = self._cut(raw, start, predicted, f"proportional {degrees_s:g}°/s", origin)
        await self._halt()
        return run

    async def _halt(self) -> None:
        await self.axis.set_rate(0.0)
        await asyncio.sleep(0.3)
        await self.axis.set_mode(Mode.IDLE)
        await self.head.rest([self.name])
        await self.axis.set_mode(Mode.POSITION)


def _place(raw: dict[str, Floats], sample: int) -> float:
    """Where the shaft stands within its count; the joint shows it where there is no backlash."""
    return float(raw["counts"][sample] + raw["shaft"][sample] % 1.0)


def mean_speed_ratio(run: Run, after: float) -> float:
    """Shaft's way over the command's way from `after` seconds on."""
    late = run.time >= after
    return float(np.ptp(run.shaft[late]) / np.ptp(run.command[late]))
