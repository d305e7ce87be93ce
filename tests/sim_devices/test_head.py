"""The head as a whole: wiring, geometry, seeds, what can be done to it, and its lines (docs/protocols)."""

import asyncio
import json
import os
import struct
from math import radians

import msgspec
import pytest

from sim_devices.bench import Bench
from sim_devices.head import JOINTS, HeadConfig, HeadMachine
from sim_devices.link.frame import FrameReceiver, Kind, encode_frame

STOPS = {"pan": 100.0, "tilt": 45.0, "left_vergence": 45.0, "right_vergence": 45.0}
EDGES = {"pan": -20.0, "tilt": -10.0, "left_vergence": -15.0, "right_vergence": -12.0}
PLACES = {"left_vergence": (1, 0), "right_vergence": (1, 1), "tilt": (1, 2), "pan": (2, 0)}


@pytest.fixture
def head():
    machine = HeadMachine(HeadConfig(start_deg=dict.fromkeys(JOINTS, 0.0)), seed=0)
    machine.power_up(0.0)
    return machine


def inputs(head, name):
    return head.channels[name].inputs


def place(head, name, degrees):
    head.verbs["place"](axis=name, angle=radians(degrees))


class TestGeometry:
    @pytest.mark.parametrize("name", JOINTS)
    def test_switches_stand_5_degrees_inside_the_stops(self, head, name):
        for way in (1, -1):
            place(head, name, way * (STOPS[name] - 5.01))
            assert inputs(head, name) & 3 == 0
            place(head, name, way * (STOPS[name] - 4.99))
            # Bit 1 is the positive end by counts, which the right eye's fall with the angle.
            positive = (way > 0) != (name == "right_vergence")
            assert inputs(head, name) & 3 == (2 if positive else 1)

    @pytest.mark.parametrize("name", JOINTS)
    def test_the_sensor_is_on_from_its_edge_to_the_positive_end_of_the_joint(self, head, name):
        for degrees, on in ((EDGES[name] - 0.01, 0), (EDGES[name] + 0.01, 4), (STOPS[name] - 6, 4)):
            place(head, name, degrees)
            assert inputs(head, name) & 4 == on

    @pytest.mark.parametrize("name", JOINTS)
    def test_counts_rise_with_the_angle_but_on_the_right_eye(self, head, name):
        per_radian = {"pan": 15915.5, "tilt": 31831.0}.get(name, 18482.5)
        place(head, name, 10.0)
        head.channels[name].settle(0.0)
        sign = -1 if name == "right_vergence" else 1
        # Whole counts, floored.
        assert head.channels[name].chip.actual == pytest.approx(sign * radians(10) * per_radian, abs=1)

    @pytest.mark.parametrize("name", JOINTS)
    def test_no_joint_can_be_placed_beyond_its_stops(self, head, name):
        with pytest.raises(ValueError, match=f"{STOPS[name]:.2f}°"):
            place(head, name, STOPS[name] + 0.1)

    @pytest.mark.parametrize("name", JOINTS)
    def test_each_joint_hangs_on_its_board_axis_and_amplifier(self, head, name):
        board, axis = PLACES[name]
        address = {"left_vergence": 1, "right_vergence": 2, "tilt": 3, "pan": 4}[name]
        place(head, name, 5.0)
        counts = struct.unpack("<i", head.boards[board].execute(0x12, axis, b""))[0]
        amplifier = next(each for each in head.amplifier_line.amplifiers if each.address == address)
        assert counts != 0
        assert struct.unpack("<i", amplifier.read(0x12, 0, 2))[0] == counts


class TestPowerUp:
    def test_joints_stand_anywhere_between_the_switches_with_counts_0(self):
        angles = {name: [] for name in JOINTS}
        for seed in range(40):
            machine = HeadMachine(seed=seed)
            machine.power_up(0.0)
            for name, angle in machine.joint_angles(0.0).items():
                angles[name].append(angle)
                assert machine.channels[name].chip.actual == 0
                assert inputs(machine, name) & 3 == 0
        for name, values in angles.items():
            limit = radians(STOPS[name] - 5)
            assert max(map(abs, values)) <= limit
            # Forty draws of a uniform law all stay out of an outer third once in ten million.
            assert min(values) < -limit / 3
            assert max(values) > limit / 3

    def test_the_seed_decides_places_and_boot_counts(self):
        def draw(seed):
            machine = HeadMachine(seed=seed)
            return machine.joint_angles(0.0), [device.boot_count for device in machine.devices.values()]

        assert draw(7) == draw(7)
        assert draw(7) != draw(8)

    def test_amplifiers_are_inhibited_and_nothing_moves(self, head):
        head.channels["pan"].joint.drive(100)
        assert head.joint_angles(1.0)["pan"] == 0.0
        assert {joint["bridge"] for joint in head.state()["joints"].values()} == {"inhibited"}


class TestConfig:
    @pytest.mark.parametrize(
        ("data", "complaint"),
        [
            ({"start_deg": {"neck": 1.0}}, "start_deg.neck: no such joint"),
            ({"start_deg": {"pan": 120.0}}, "stops are at ±100"),
            ({"friction_counts": -1.0}, "friction_counts"),
            ({"backlash": 1.0}, "backlash"),
            ({"peak_current": 5.0}, "peak_current 5.0 A"),
        ],
    )
    def test_a_mistake_is_told_by_name_and_value(self, data, complaint):
        with pytest.raises(msgspec.ValidationError, match=complaint):
            msgspec.convert(data, HeadConfig)

    def test_friction_and_backlash_are_0_unless_configured(self):
        assert (HeadConfig().friction_counts, HeadConfig().backlash_deg) == (0.0, 0.0)

    def test_backlash_is_the_whole_gap_at_the_joint(self):
        machine = HeadMachine(HeadConfig(backlash_deg=0.02), seed=0)
        assert 2 * machine.joints["pan"].geometry.half_backlash == pytest.approx(radians(0.02) * 15915.5)


class TestState:
    def test_is_json_and_tells_the_truth(self, head):
        place(head, "tilt", 12.0)
        head.verbs["amplifier_fault"](axis="pan", fault="short_circuit")
        state = json.loads(json.dumps(head.state()))
        assert state["joints"]["tilt"]["angle"] == pytest.approx(radians(12.0))
        assert state["joints"]["pan"]["faults"] == ["SHORT_CIRCUIT"]
        assert set(state["joints"]["pan"]) >= {
            "angle",
            "velocity",
            "current",
            "negative_switch",
            "positive_switch",
            "sensor",
            "motor_command",
            "bridge",
        }
        assert set(state["boards"]) == {"1", "2"}

    def test_velocity_has_the_sign_of_the_angle_on_the_mirrored_eye_too(self, head):
        for name in ("left_vergence", "right_vergence"):
            amplifier = head.amplifiers[name]
            amplifier.write(7, 0, b"\x0f\0")
            amplifier.write(1, 0, b"\0\0")
            head.joints[name].drive(20)
        before = head.joint_angles(0.0)
        after = head.joint_angles(0.05)
        for name in ("left_vergence", "right_vergence"):
            velocity = head.state()["joints"][name]["velocity"]
            assert velocity * (after[name] - before[name]) > 0


class TestVerbs:
    @pytest.mark.parametrize(
        ("verb", "arguments", "complaint"),
        [
            ("place", {"axis": "neck", "angle": 0.0}, "no axis 'neck'"),
            ("amplifier_fault", {"axis": "pan", "fault": "rain"}, "no fault 'rain'"),
            ("encoder_loss", {"axis": "pan", "at": "home"}, "board, amplifier, both"),
            ("sensor", {"axis": "pan", "stuck": "half"}, "on, off, free"),
            ("switch", {"axis": "pan", "side": "top", "held": "open"}, "negative, positive"),
            ("switch", {"axis": "pan", "side": "positive", "held": "ajar"}, "closed, open, free"),
            ("restart_board", {"board": 3}, "no board 3"),
            ("bus_voltage", {"volts": -1.0}, "-1.0 V"),
            ("current_limits", {"peak": 1.0, "continuous": 2.0}, "continuous"),
        ],
    )
    def test_a_wrong_argument_is_one_clear_line(self, head, verb, arguments, complaint):
        with pytest.raises(ValueError, match=complaint):
            head.verbs[verb](**arguments)

    def test_a_board_that_restarts_loses_all_but_the_joints_places(self, head):
        place(head, "left_vergence", 7.0)
        boots = head.devices[1].boot_count
        head.verbs["restart_board"](board=1)
        assert head.devices[1].boot_count == (boots + 1) & 0xFFFF
        assert head.channels["left_vergence"].chip.actual == 0
        assert head.joint_angles(0.0)["left_vergence"] == pytest.approx(radians(7.0))

    def test_an_amplifier_fault_outlives_the_boards_restart(self, head):
        head.verbs["amplifier_fault"](axis="tilt")
        head.verbs["restart_board"](board=1)
        assert inputs(head, "tilt") & 0x48 == 0x48


class TestLines:
    async def test_boards_and_amplifiers_answer_behind_their_ports(self):
        async with Bench({"head": HeadMachine(seed=1)}, seed=1) as bench:
            assert set(bench.ports) == {"mc3000", "servo-amps"}
            boards = Port(bench.ports["mc3000"])
            for address in (1, 2):
                frame = encode_frame(address, Kind.REQUEST, 5, 0x01, 0x0F, b"\xef\xbe")
                reply = await boards.ask(frame)
                (message,) = FrameReceiver().feed(reply)
                assert message[:5] == (address, Kind.REPLY, 5, 0x01, 0)
                assert message.payload.endswith(struct.pack("<BI", 3, 2000000))
            amps = Port(bench.ports["servo-amps"])
            # Vector "read bridge status and protection, 2 words".
            reply = await amps.ask(bytes.fromhex("a5010102000230ee"))
            assert reply[:6] == bytes.fromhex("a5ff02010002")
            assert reply[8:12] == bytes.fromhex("00000100")

    async def test_a_fault_injected_on_the_amplifier_reaches_the_boards_host_within_10_ms(self):
        machine = HeadMachine(seed=1)
        async with Bench({"head": machine}, seed=1) as bench:
            port = Port(bench.ports["mc3000"])
            await port.ask(encode_frame(1, Kind.REQUEST, 1, 0x01, 0x0F, b"ab"))
            await port.ask(encode_frame(1, Kind.REQUEST, 2, 0x07, 0x0F, b"\xff\xff\xff\xff"))
            bench.inject("head.amplifier_fault", axis="tilt")
            (event,) = FrameReceiver().feed(await port.ask(b"", wait=0.01))
            assert (event.kind, event.operation, event.axis) == (Kind.EVENT, 0x48, 2)


class Port:
    """A client of a pseudo-terminal: writes, lets virtual time pass, reads what came."""

    def __init__(self, path):
        self.fd = os.open(path, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)

    async def ask(self, data, wait=0.03):
        if data:
            os.write(self.fd, data)
        await asyncio.sleep(wait)
        return os.read(self.fd, 4096)

    def __del__(self):
        os.close(self.fd)
