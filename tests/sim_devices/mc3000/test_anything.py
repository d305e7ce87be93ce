"""Whatever a host asks, in whatever order, the board answers, keeps its invariants and moves nothing it may not."""

import random

import pytest

WHOLE = 0x0F
LENGTHS = [2, None, 0, 4, 0, 4, 1, 2, 3, 5, 1, 4, 0, 1, 1, 2, 0, 0, 0]
INCIDENTS = [
    ("amplifier_fault", {"fault": "over_temperature", "on": True}),
    ("amplifier_fault", {"fault": "over_temperature", "on": False}),
    ("encoder_loss", {"on": True, "at": "both"}),
    ("encoder_loss", {"on": False, "at": "both"}),
    ("switch", {"side": "positive", "held": "closed"}),
    ("switch", {"side": "positive", "held": "free"}),
    ("sensor", {"stuck": "on"}),
    ("sensor", {"stuck": "free"}),
    ("stop_input", {"on": True}),
    ("stop_input", {"on": False}),
]


def random_request(source):
    operation = source.choice([*range(0x10, 0x23), *range(0x10, 0x23), 0x05, 0x06, 0x04, 0x01])
    axis = source.choice([0, 0, 0, 1, 2, WHOLE])
    if operation < 0x10:
        length = {0x05: 0, 0x06: 0, 0x04: 3, 0x01: 2}[operation]
        payload = b"\x40\0\0" if operation == 0x04 else source.randbytes(length)
        return operation, payload, WHOLE if operation != 0x06 else axis
    length = LENGTHS[operation - 0x10]
    payload = source.randbytes(source.randrange(2, 6) if length is None else length)
    if operation == 0x16:
        payload = bytes([source.randrange(4)])
    elif operation == 0x15:
        payload = bytes([225, 0, 5, source.choice([7, 15, 124, 255])])
    elif operation in (0x13, 0x19):
        payload = source.randrange(-3000, 3000).to_bytes(4, "little", signed=True) + bytes(length - 4)
        payload = payload[:-1] + bytes([source.randrange(2)]) if operation == 0x19 else payload
    elif operation == 0x17:
        payload = source.randrange(-60, 60).to_bytes(2, "little", signed=True)
    elif operation in (0x14, 0x1A):
        axis = WHOLE
    return operation, payload, axis


@pytest.mark.parametrize("seed", range(6))
def test_random_sessions(make_rig, seed):
    source = random.Random(seed)
    friction = {"friction_counts": 2.0, "backlash_deg": 0.02} if seed % 2 else {}
    rig = make_rig(**friction)
    for axis in range(3):
        rig.filter(axis)
        rig.profile(300, 60, axis)
    answered = set()
    for _ in range(500):
        operation, payload, axis = random_request(source)
        status, _reply = rig.ask(operation, payload, axis)
        answered.add(status)
        if source.random() < 0.06:
            verb, arguments = source.choice(INCIDENTS)
            rig.inject(verb, axis=source.choice(["left_vergence", "right_vergence", "tilt"]), **arguments)
        rig.run(source.choice([0.0, 1e-4, 0.004, 0.03]))
        for number in range(3):
            shown, settings = rig.snapshot(number), rig.settings(number)
            latched = shown.inputs & 0x70
            idle = bool(shown.flags & 0x02)
            assert idle == (settings.mode == 0)
            # Whatever is latched keeps the axis idle and its output at zero.
            assert not latched or (idle and shown.motor == 0x80)
            assert bool(shown.status & 0x80) != bool(shown.inputs & 0x10)
            assert not settings.armed or settings.mode == 1
    assert answered <= set(range(11))
    assert {0, 4, 5, 6} <= answered
