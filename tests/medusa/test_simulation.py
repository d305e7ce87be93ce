"""`--sim`: the whole head in one process and in virtual time, the same every run."""

import asyncio
import math
from pathlib import Path

import pytest

from medusa.config.file import parse_config
from medusa.link import Trace
from medusa.mc3000.simulated_config import simulated_config, simulated_toml
from medusa.simulation import simulated_head
from sim_devices.clock import run_virtual
from sim_devices.head_config import HeadConfig
from sim_devices.link.faults import FaultPlan

NEAR_SENSORS = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}


def run(seed: int, trace: Path, faults: FaultPlan | None = None) -> list[str]:
    async def program() -> list[str]:
        written = Trace(trace)
        told = []
        machine = HeadConfig(start_deg=NEAR_SENSORS, friction_counts=2.0, backlash_deg=0.02)
        async with simulated_head(seed=seed, config=machine, faults=faults) as sim:
            async with sim.open(trace=written) as head:
                told.append(repr(await head.home()))
                told.append(repr(await head.move({"pan": 0.3, "tilt": -0.1, "left_vergence": 0.1})))
                await head.velocity({"pan": math.radians(-20)})
                await asyncio.sleep(0.5)
                await head.stop()
                told.append(repr(await head.park()))
            told.append(repr(sim.bench.state()["head"]))
        written.close()
        return told

    return run_virtual(program())


@pytest.mark.parametrize("faults", [None, FaultPlan(drop=0.02, double=0.02, delay=0.05, delay_s=0.05)])
def test_two_runs_with_one_seed_are_alike_to_the_byte(tmp_path: Path, faults: FaultPlan | None) -> None:
    first, second = (run(4, tmp_path / name, faults) for name in ("first", "second"))
    assert first == second
    bytes_on_the_wire = (tmp_path / "first").read_bytes()
    assert len(bytes_on_the_wire) > 10_000
    assert bytes_on_the_wire == (tmp_path / "second").read_bytes()


def test_another_seed_is_another_run(tmp_path: Path) -> None:
    assert run(4, tmp_path / "four") != run(5, tmp_path / "five")


def test_the_simulated_configuration_is_the_template_filled_in() -> None:
    assert parse_config(simulated_toml(), "any", recorded=False) == simulated_config()


async def test_the_simulated_head_homes_without_a_check_since_its_wiring_is_known() -> None:
    async with simulated_head(seed=0, config=HeadConfig(start_deg=NEAR_SENSORS)) as sim, sim.open() as head:
        assert sim.config.file is None
        assert set(await head.home(["pan"])) == {"pan"}
