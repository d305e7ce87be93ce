"""Faults of the wire by a seeded plan, over real pseudo-terminals."""

import asyncio

import pytest

from sim_devices.clock import run_virtual
from sim_devices.link.device import LinkDevice
from sim_devices.link.faults import FaultPlan
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame
from sim_devices.link.line import Line

BYTE = 10 / 115200
HELLO, PING = 1, 2


def test_the_same_seed_gives_the_same_bytes_at_the_same_times(run_over_faults):
    plan = FaultPlan(seed=3, drop=0.1, flip=0.1, insert=0.1, double=0.1, split=0.1, delay=0.1, stall=0.02)
    first, second = run_virtual(run_over_faults(plan)), run_virtual(run_over_faults(plan))
    assert first == second
    assert first != run_virtual(run_over_faults(FaultPlan(seed=4, drop=0.1, flip=0.1)))


async def test_dropped_frames_are_gone_and_the_others_are_whole_and_in_order(run_over_faults):
    heard, _ = await run_over_faults(FaultPlan(seed=1, drop=0.2, direction="to_device"))
    numbers = [data[0] for _, data in heard]
    assert all(data == data[:1] * 8 for _, data in heard)
    assert numbers == sorted(numbers)
    # 200 tries at 0.2: 40 ± 5.7, six standard deviations either way.
    assert 6 < 200 - len(numbers) < 75


async def test_flipped_frames_keep_their_length_and_differ_in_one_to_three_bits(run_over_faults):
    heard, _ = await run_over_faults(FaultPlan(seed=1, flip=1.0, direction="to_device"), frames=100)
    for n, (_, data) in enumerate(heard):
        wrong = int.from_bytes(data, "big") ^ int.from_bytes(bytes((n,)) * 8, "big")
        assert len(data) == 8
        assert wrong.bit_count() <= 3
    assert len(heard) == 100


async def test_inserted_bytes_take_their_time_on_the_wire(run_over_faults):
    heard, _ = await run_over_faults(FaultPlan(seed=1, insert=1.0, direction="to_device"), frames=1)
    ((t, data),) = heard
    assert len(data) == 9
    assert t == pytest.approx(9 * BYTE)


async def test_a_double_follows_its_original_directly(run_over_faults):
    heard, _ = await run_over_faults(FaultPlan(seed=1, double=1.0, direction="to_device"), frames=20)
    assert [data[0] for _, data in heard] == [n for n in range(20) for _ in "ab"]
    assert heard[1][0] - heard[0][0] == pytest.approx(8 * BYTE)


async def test_split_frames_come_in_two_pieces_with_a_gap(run_over_faults):
    heard, _ = await run_over_faults(
        FaultPlan(seed=1, split=1.0, split_s=0.004, direction="to_device"), frames=20
    )
    assert len(heard) == 40
    assert b"".join(data for _, data in heard) == b"".join(bytes((n,)) * 8 for n in range(20))
    gaps = [heard[n + 1][0] - heard[n][0] - len(heard[n + 1][1]) * BYTE for n in range(0, len(heard), 2)]
    assert max(gaps) > 0.001
    assert all(-1e-9 < gap <= 0.004 + 1e-9 for gap in gaps)


async def test_delayed_frames_keep_their_order(run_over_faults):
    heard, _ = await run_over_faults(
        FaultPlan(seed=1, delay=0.3, delay_s=0.3, direction="to_device"), frames=100, gap=0.05
    )
    assert [data[0] for _, data in heard] == list(range(100))
    late = [t - 0.05 * n - 8 * BYTE for n, (t, _) in enumerate(heard)]
    assert min(late) == pytest.approx(0, abs=1e-9)
    assert max(late) > 0.1


async def test_only_the_planned_direction_and_time_are_faulty(run_over_faults):
    heard, got = await run_over_faults(
        FaultPlan(seed=1, drop=1.0, direction="to_host", start_s=1.0, end_s=1.5)
    )
    assert [data[0] for _, data in heard] == list(range(200))
    back = {data[0] for _, data in got}
    assert back == set(range(100)) | set(range(150, 200))


async def test_a_planned_hang_up_pulls_the_cable(tmp_path, make_echo, connect):
    async with Line([make_echo()], faults=FaultPlan(seed=1, hang_up=1.0), link=tmp_path / "port") as line:
        client = connect(line.path)
        client.write(b"the last words")
        await asyncio.sleep(0.5)
        assert not client.open
        assert not line.plugged
        await asyncio.sleep(0.6)
        assert line.plugged


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"drop": 1.5}, "drop is 1.5, must be a probability"),
        ({"delay_s": -1.0}, "delay_s is -1.0, must be 0 s or more"),
        ({"direction": "up"}, "direction is 'up', must be one of"),
    ],
)
def test_an_impossible_plan_is_refused(wrong, said):
    with pytest.raises(ValueError, match=said):
        FaultPlan(**wrong)


def test_two_runs_of_a_session_are_alike_to_the_byte(hand, connect):
    async def session():
        device = LinkDevice(0x21, type(hand.lamp)(), boot_count=3)
        async with Line([device], faults=FaultPlan(seed=8, drop=0.1, flip=0.05, split=0.2)) as line:
            client = connect(line.path)
            client.write(encode_frame(0x21, 0, 0, HELLO, 15, b"ab"))
            for n in range(1, 100):
                await asyncio.sleep(0.013)
                client.write(encode_frame(0x21, 0, n % 64, PING, 15))
            await asyncio.sleep(1.0)
            client.close()
        return client.got

    first = run_virtual(session())
    assert first == run_virtual(session())
    replies = [m for m in FrameReceiver().feed(b"".join(data for _, data in first)) if isinstance(m, tuple)]
    assert 50 < len(replies) < 100
    assert all(message.kind == Kind.REPLY for message in replies)
