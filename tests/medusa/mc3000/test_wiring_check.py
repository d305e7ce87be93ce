"""`check`: short open-loop pulses, their sign, and the record without which nothing homes."""

import asyncio
import json
import math
from pathlib import Path

import pytest

from medusa.config.file import load_config, write_keys
from medusa.errors import CommandError, ConfigError, DeviceFault
from medusa.mc3000.check_record import CheckRecord
from medusa.mc3000.drive import Mc3000Drive
from medusa.mc3000.simulated_config import simulated_toml
from medusa.mc3000.wiring_check import check_axis
from medusa.simulation import SimulatedHead, simulated_head
from sim_devices.head_config import HeadConfig


@pytest.fixture
def config_path(tmp_path: Path) -> Path:
    path = tmp_path / "head.toml"
    path.write_text(simulated_toml())
    return path


@pytest.mark.parametrize("name", ["pan", "tilt", "left_vergence", "right_vergence"])
async def test_pulses_stay_within_four_dac_counts_and_fifty_milliseconds(
    sim: SimulatedHead, name: str
) -> None:
    with sim.machine.record(name) as record:
        async with sim.open() as head:
            result = await check_axis(head, name)
    assert max(abs(dac) for dac in record.motor_command) <= 4
    driven = [t for t, dac in zip(record.time, record.motor_command, strict=True) if dac != 0]
    # Two pulses of 50 ms; each begins and ends up to one sample late, and a request takes two milliseconds.
    assert len(driven) * (record.time[1] - record.time[0]) <= 2 * (0.05 + 0.003)
    # C·4·(t − T_M) counts with the largest C of 1235: nowhere near half a degree.
    assert max(record.angle) - min(record.angle) < math.radians(0.6)
    assert result.forward_counts * Mc3000Drive.of(head).axes[name].config.sign > 0
    assert result.backward_counts * Mc3000Drive.of(head).axes[name].config.sign < 0


async def test_a_checked_joint_is_left_disabled(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        await check_axis(head, "pan")
        joint = sim.bench.state()["head"]["joints"]["pan"]
        assert (joint["mode"], joint["motor_command"], joint["bridge"]) == (0, 0, "inhibited")


async def test_friction_asks_for_more_but_never_for_more_than_four() -> None:
    async with simulated_head(config=HeadConfig(friction_counts=2.0)) as sim, sim.open() as head:
        assert (await check_axis(head, "tilt")).motor_command_counts in (3, 4)
    async with simulated_head(config=HeadConfig(friction_counts=6.0)) as sim, sim.open() as head:
        with pytest.raises(
            DeviceFault, match=r"tilt: 0 counts after 4 DAC counts for 50 ms, 10 needed: no power"
        ):
            await check_axis(head, "tilt")


async def test_a_lost_encoder_is_found(sim: SimulatedHead) -> None:
    sim.bench.inject("head.encoder_loss", axis="left_vergence")
    async with sim.open() as head:
        with pytest.raises(DeviceFault, match="left_vergence: 0 counts after 4 DAC counts"):
            await check_axis(head, "left_vergence")


async def test_a_joint_on_a_limit_switch_is_not_pulsed(sim: SimulatedHead) -> None:
    sim.bench.inject("head.place", axis="pan", angle=math.radians(96))
    async with sim.open() as head:
        with pytest.raises(CommandError, match="pan: on a limit switch"):
            await check_axis(head, "pan")


async def test_home_refuses_what_was_not_checked_with_this_configuration(
    sim: SimulatedHead, config_path: Path
) -> None:
    config = load_config(config_path)
    async with sim.open(config) as head:
        with pytest.raises(CommandError, match="pan, tilt, left_vergence, right_vergence: not checked since"):
            await head.home()
        await check_axis(head, "pan")
        await head.home(["pan"])
    changed = write_keys(config_path, {"axes.pan.filters.position.K": 6})
    async with sim.open(changed) as head:
        with pytest.raises(CommandError, match="pan: not checked since the configuration changed"):
            await head.home(["pan"])


def test_the_record_lies_beside_the_configuration(config_path: Path) -> None:
    config = load_config(config_path)
    record = CheckRecord.of(config, "/dev/ttyUSB0")
    assert not record.holds("pan", config)
    record.add("pan", config)
    again = CheckRecord.of(config, "/dev/ttyUSB0")
    assert again.holds("pan", config)
    assert not again.holds("tilt", config)
    stored = json.loads((config_path.parent / "head.checked.json").read_text())
    assert list(stored) == ["pan on /dev/ttyUSB0"]


def test_what_the_emulated_head_passed_does_not_count_for_the_real_one(config_path: Path) -> None:
    config = load_config(config_path)
    CheckRecord.of(config, "simulated").add("pan", config)
    assert CheckRecord.of(config, "simulated").holds("pan", config)
    assert not CheckRecord.of(config, "/dev/ttyUSB0").holds("pan", config)
    CheckRecord.of(config, "/dev/ttyUSB0").add("pan", config)
    assert CheckRecord.of(config, "simulated").holds("pan", config)


@pytest.mark.parametrize("text", ["{", "[]", "\x00"])
def test_a_spoilt_record_is_one_line(config_path: Path, text: str) -> None:
    (config_path.parent / "head.checked.json").write_text(text)
    with pytest.raises(ConfigError, match=r"head\.checked\.json: the record of checks"):
        CheckRecord.of(load_config(config_path), "/dev/ttyUSB0")


async def test_a_host_that_dies_in_a_pulse_leaves_the_watchdog_to_end_it(sim: SimulatedHead) -> None:
    async with sim.open() as head:
        checking = asyncio.ensure_future(check_axis(head, "pan"))
        for _ in range(200):
            if sim.bench.state()["head"]["joints"]["pan"]["motor_command"] != 0:
                break
            await asyncio.sleep(0.005)
        sim.bench.inject("wire.unplug", line="mc3000")
        await asyncio.gather(checking, return_exceptions=True)
        # The board's watchdog of 0.4 s.
        await asyncio.sleep(0.45)
        assert sim.bench.state()["head"]["joints"]["pan"]["motor_command"] == 0
        sim.bench.inject("wire.plug", line="mc3000")
        await asyncio.sleep(3.0)
