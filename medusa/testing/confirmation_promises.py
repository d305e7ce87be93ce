"""What every drive promises of confirmation: a stop counts when it has been read back, and then it is true."""

import asyncio
from dataclasses import replace

import pytest

from medusa.errors import DeviceFault
from medusa.head.drive import Reading
from medusa.head.faults import Cause
from medusa.head.stopping import MARGIN_SECONDS
from medusa.testing.bench import Bench
from medusa.testing.opened import Opened


class ConfirmationPromises(Opened):
    """Stops that are not obeyed, not latched or not true are errors."""

    async def test_an_old_reading_confirms_no_stop(self, bench: Bench) -> None:
        name = bench.joints[0]
        await bench.group.move({name: bench.target(name, 0.0)})
        drive, read = bench.group.drive, bench.group.drive.read
        old = [await read()]
        await asyncio.sleep(0.03)
        old.append(await read())

        async def repeat(names: object = None) -> Reading:
            return old.pop(0) if len(old) > 1 else old[0]

        await bench.group.velocity({name: bench.speed(name, 0.1)})
        drive.read = repeat  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="could not be confirmed"):
            await bench.group.stop()
        drive.read = read  # type: ignore[method-assign]
        await bench.group.clear()
        await bench.group.enable()

    async def test_one_reading_twice_confirms_no_stop(self, bench: Bench) -> None:
        drive, read = bench.group.drive, bench.group.drive.read
        again: list[Reading] = []

        async def repeat(names: object = None) -> Reading:
            if not again:
                reading = await read()
                still = {name: replace(joint, moving=False) for name, joint in reading.joints.items()}
                again.append(replace(reading, joints=still))
            return again[0]

        await bench.group.move({bench.joints[0]: bench.target(bench.joints[0], 0.0)})
        await bench.group.velocity({bench.joints[0]: bench.speed(bench.joints[0], 0.1)})
        drive.read = repeat  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="could not be confirmed"):
            await bench.group.stop()
        drive.read = read  # type: ignore[method-assign]

    async def test_a_stop_that_is_not_obeyed_becomes_an_emergency_stop(self, bench: Bench) -> None:
        name = bench.joints[0]
        await bench.group.move({name: bench.target(name, -0.8)})
        await bench.group.velocity({name: bench.speed(name, 0.1)})
        drive = bench.group.drive
        obeyed, drive.stop = drive.stop, lambda names: asyncio.sleep(0)  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="stop could not be confirmed"):
            await bench.group.stop()
        drive.stop = obeyed  # type: ignore[method-assign]
        await asyncio.sleep(MARGIN_SECONDS)
        assert await bench.at_rest()
        joints = (await bench.group.read()).joints
        assert all(Cause.EMERGENCY_STOP in joint.latched for joint in joints.values())

    @pytest.mark.parametrize("instead", ["stop", "disable"])
    async def test_an_emergency_stop_that_is_not_latched_is_an_error(
        self, bench: Bench, instead: str
    ) -> None:
        drive = bench.group.drive
        drive.emergency_stop = lambda: getattr(drive, instead)(bench.joints)  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="emergency stop could not be confirmed"):
            await bench.group.emergency_stop()

    async def test_an_emergency_stop_that_leaves_joints_driven_is_an_error(self, bench: Bench) -> None:
        drive, read = bench.group.drive, bench.group.drive.read
        if bench.group.can.emergency == "holds":
            pytest.skip("this machine holds its joints after an emergency stop")

        async def driven(names: object = None) -> Reading:
            reading = await read()
            joints = {name: replace(joint, enabled=True) for name, joint in reading.joints.items()}
            return replace(reading, joints=joints)

        drive.read = driven  # type: ignore[method-assign]
        with pytest.raises(DeviceFault, match="emergency stop could not be confirmed"):
            await bench.group.emergency_stop()
        drive.read = read  # type: ignore[method-assign]
