"""A host that is killed while it jogs a joint: the joint stands by the board's watchdog."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import pytest

from sim_devices.control import call

JOG_DEG_S = 10.0
WATCHDOG_S, RAMP_S = 0.4, 0.21
SCHEDULING_S = 0.5
"""What a busy machine may delay: a frame under way, or a process between two of its lines."""

HOST = """
import asyncio, math, sys
from medusa.machines import open_head
from medusa.mc3000.simulated_config import simulated_config
from medusa.head.joint_group import JointGroup

async def jog():
    async with open_head(simulated_config(), sys.argv[1], sys.argv[2]) as head:
        await head.home(["pan"])
        await head.velocity({"pan": math.radians(float(sys.argv[3]))})
        print("jogging", flush=True)
        await asyncio.sleep(60)

asyncio.run(jog())
"""


def joint(links: Path) -> dict[str, Any]:
    pan: dict[str, Any] = call(links, "inspect")["head"]["joints"]["pan"]
    return pan


def joint_when(links: Path, reached: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """The joint as soon as it is as wished; as it is after a generous while."""
    deadline = time.monotonic() + 20
    pan = joint(links)
    while not reached(pan) and time.monotonic() < deadline:
        pan = joint(links)
    return pan


@pytest.fixture
def links(tmp_path: Path, serving: Callable[[Path, str], AbstractContextManager[Path]]) -> Iterator[Path]:
    with serving(tmp_path, "[head.start_deg]\npan = -22.5\n") as links:
        yield links


@pytest.mark.real_time
def test_a_joint_stands_within_watchdog_and_ramp_after_its_host_was_killed(links: Path) -> None:
    host = subprocess.Popen(
        [sys.executable, "-c", HOST, links / "mc3000", links / "servo-amps", str(JOG_DEG_S)],
        stdout=subprocess.PIPE,
        text=True,
    )
    assert host.stdout is not None
    assert host.stdout.readline().strip() == "jogging"
    asked = time.monotonic()
    before = joint(links)
    os.kill(host.pid, signal.SIGKILL)
    unknown = time.monotonic() - asked
    host.wait()
    host.stdout.close()
    after = joint_when(links, lambda pan: pan["mode"] == 0 and abs(pan["velocity"]) < 1e-6)
    assert abs(before["velocity"]) > 0
    assert (after["mode"], after["motor_command"]) == (0, 0)
    assert after["velocity"] == pytest.approx(0.0, abs=1e-6)
    # It went on for the watchdog and the ramp, and for what passed between the reading and the kill.
    limit = 0.1745 * (unknown + WATCHDOG_S + RAMP_S + SCHEDULING_S)
    assert 0.0 <= after["angle"] - before["angle"] <= limit
    # Long after that the amplifier's own watchdog has inhibited it, and nothing has moved.
    final = joint_when(links, lambda pan: pan["bridge"] == "inhibited")
    assert final["bridge"] == "inhibited"
    assert final["angle"] == pytest.approx(after["angle"], abs=1e-6)
