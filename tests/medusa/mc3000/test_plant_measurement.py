"""Identification on the emulated head: accuracy, bounds, refusals, and a host that dies in a pulse."""

import asyncio
import math

import pytest

from medusa.errors import CommandError, DeviceFault, MedusaError
from medusa.mc3000.board import Mode
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.plant_measurement import Excitation, measure_plant
from medusa.servo.thesis import AXES
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices.head_config import HeadConfig


@pytest.mark.parametrize("name", ["pan", "right_vergence"])
async def test_frictionless_plant_is_found_to_three_and_one_per_cent(name: str) -> None:
    async with simulated_head(seed=4) as sim, sim.open() as head:
        await head.home([name])
        found = await measure_plant(head, name)
        truth = AXES[name].plant
        assert found.plant.time_constant == pytest.approx(truth.time_constant, rel=0.03)  # the bounds
        assert found.plant.velocity_gain == pytest.approx(truth.velocity_gain, rel=0.01)
        assert abs(found.asymmetry) < 0.01
        assert Mc3000Drive.of(head).axes[name].mode is Mode.IDLE
        # The pulses come in pairs: the joint is left within an excursion of where it was.
        assert abs((await head.read()).joints[name].angle) < math.radians(8.0)


async def test_with_friction_and_backlash_it_is_within_its_stated_uncertainty_and_ten_per_cent() -> None:
    machine = HeadConfig(friction_counts=2.0, backlash_deg=0.02)
    async with simulated_head(seed=6, config=machine) as sim, sim.open() as head:
        await head.home(["tilt"])
        found = await measure_plant(head, "tilt")
        truth = AXES["tilt"].plant
        error = abs(found.plant.time_constant - truth.time_constant)
        assert error < 0.1 * truth.time_constant
        assert error <= 1.5 * found.time_constant_error  # stated: two standard deviations; three hold
        assert found.plant.velocity_gain == pytest.approx(truth.velocity_gain, rel=0.1)
        assert found.friction_dac == pytest.approx(2.0, abs=0.1)


async def test_an_axis_not_homed_or_near_a_limit_is_refused_and_nothing_moves() -> None:
    async with simulated_head(seed=4) as sim, sim.open() as head:
        before = sim.machine.joint_angles(asyncio.get_running_loop().time())
        with pytest.raises(CommandError, match="left_vergence: is not homed"):
            await measure_plant(head, "left_vergence")
        assert head.enabled == frozenset()
        await head.home(["left_vergence"])
        await head.move({"left_vergence": math.radians(30.0)})
        with pytest.raises(
            CommandError, match=r"is at 30\.\d+°, [78]\.\d+° from its soft limit of 38\.00°.*16\.00°"
        ):
            await measure_plant(head, "left_vergence")
        with pytest.raises(CommandError, match="no joint 'neck'"):
            await measure_plant(head, "neck")
        after = sim.machine.joint_angles(asyncio.get_running_loop().time())
        assert after["pan"] == before["pan"]
        # At rest where it was moved to: within the dead band of 7 counts.
        assert after["left_vergence"] == pytest.approx(math.radians(30.0), abs=math.radians(7 / 322.58))


async def test_excitation_stays_within_its_excursion() -> None:
    async with simulated_head(seed=4) as sim, sim.open() as head:
        await head.home(["left_vergence"])
        start = sim.machine.joint_angles(asyncio.get_running_loop().time())["left_vergence"]
        with sim.machine.record("left_vergence") as recording:
            await measure_plant(head, "left_vergence", Excitation(excursion=math.radians(5.0)))
        away = max(abs(angle - start) for angle in recording.angle)
        assert math.radians(2.0) < away < math.radians(7.5)  # stopped by force at 1.5 excursions


async def test_a_cable_pulled_in_a_pulse_leaves_the_joint_idle_inside_its_limits() -> None:
    async with simulated_head(seed=4) as sim:

        async def measure() -> None:
            async with sim.open() as head:
                await head.home(["tilt"])
                await measure_plant(head, "tilt")

        measuring = asyncio.create_task(measure())
        await _until_driven(sim, "tilt", 5)
        sim.bench.inject("wire.unplug", line="mc3000")
        with pytest.raises(MedusaError):
            await measuring
        await asyncio.sleep(0.5)
        angles = sim.machine.joint_angles(asyncio.get_running_loop().time())
        state = sim.machine.state()["joints"]["tilt"]
        assert state["motor_command"] == 0
        assert state["velocity"] == pytest.approx(0.0, abs=1e-3)
        assert abs(angles["tilt"]) < math.radians(38.0)


async def _until_driven(sim: SimulatedHead, name: str, dac: int) -> None:
    """Wait for an idle joint that gets at least `dac` counts, at most half a minute."""
    for _ in range(15_000):
        sim.machine.advance_to(asyncio.get_running_loop().time())
        joint = sim.machine.state()["joints"][name]
        if joint["mode"] == 0 and abs(joint["motor_command"]) >= dac:
            return
        await asyncio.sleep(0.002)
    raise AssertionError(f"{name} was never driven by {dac} DAC counts")


async def test_an_emergency_stop_in_a_pulse_is_a_fault_of_the_joint_not_a_mistake_of_the_caller() -> None:
    async with simulated_head(seed=4) as sim, sim.open() as head:
        await head.home(["tilt"])
        where = (await head.read()).joints["tilt"].angle
        measuring = asyncio.create_task(measure_plant(head, "tilt"))
        await _until_driven(sim, "tilt", 5)
        sim.bench.inject("head.emergency_stop")
        with pytest.raises(
            DeviceFault, match=r"tilt: stopped while it was measured.*emergency stop"
        ) as caught:
            await measuring
        assert caught.value.axis == "tilt"
        assert abs((await head.read()).joints["tilt"].angle - where) < math.radians(16.0)  # two excursions


async def test_a_joint_without_power_is_a_fault_with_its_reason() -> None:
    async with simulated_head(seed=4) as sim, sim.open() as head:
        await head.home(["pan"])
        sim.bench.inject("head.current_limits", axis="pan", peak=1e-4, continuous=1e-4)
        with pytest.raises(DeviceFault, match=r"pan: \d counts after"):
            await measure_plant(head, "pan")
        assert Mc3000Drive.of(head).axes["pan"].mode is Mode.IDLE


@pytest.mark.parametrize(
    "wrong",
    [{"excursion": 0.0}, {"excursion": 2.0}, {"pulse_seconds": 5.0}, {"largest_dac": 200}, {"repeats": 0}],
)
def test_an_excitation_out_of_bounds_is_refused(wrong: dict[str, float]) -> None:
    with pytest.raises(CommandError, match="not in"):
        Excitation(**wrong)  # type: ignore[arg-type]
