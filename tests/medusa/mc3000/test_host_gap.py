"""A host that was away for longer than the boards' watchdog: named by the link itself, whatever became of the event."""

import asyncio
import math

import pytest

from medusa.errors import MedusaError
from medusa.head import Cause, Fault
from medusa.simulation import simulated_head
from sim_devices.clock import VirtualTimeLoop
from sim_devices.head_config import HeadConfig
from sim_devices.link.faults import FaultPlan

NEAR_SENSORS = {"pan": -23.0, "tilt": -13.0, "left_vergence": -18.0, "right_vergence": -15.0}
GAP_AT = 12.0


async def test_a_gap_is_reported_although_the_boards_events_are_lost() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualTimeLoop)
    # Everything from the boards is lost from the gap on, the six sendings of the watchdog's event among it.
    lossy = {"mc3000": FaultPlan(drop=1.0, direction="to_host", start_s=GAP_AT, end_s=GAP_AT + 1.9)}
    faults: list[Fault] = []
    async with simulated_head(1, HeadConfig(start_deg=NEAR_SENSORS), lossy) as sim, sim.open() as head:
        head.subscribe(faults.append)
        await head.home()
        await asyncio.sleep(GAP_AT - 0.2 - loop.time())
        await head.velocity({"pan": math.radians(20)})
        await asyncio.sleep(GAP_AT - loop.time())
        loop.block(1.2)
        await asyncio.sleep(0.01)
        assert {fault.cause for fault in faults} == {Cause.WATCHDOG}
        assert "not fed for 1.2" in faults[0].reason
        where = sim.machine.joint_angles(loop.time())["pan"]
        with pytest.raises(MedusaError):
            await head.velocity({"pan": math.radians(20)})
        await asyncio.sleep(GAP_AT + 4.0 - loop.time())
        assert sim.machine.joint_angles(loop.time())["pan"] == pytest.approx(where, abs=1e-3)
        await head.clear()
        await head.enable()
        assert (await head.move({"pan": 0.0})).all_settled
