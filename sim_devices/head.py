"""The emulated head: two boards, four amplifiers, four joints, and how they are wired."""

import random
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from math import radians
from typing import Any

from sim_devices.head_config import JOINTS, HeadConfig, JointConfig
from sim_devices.head_incidents import HeadIncidents
from sim_devices.joint import Joint, JointGeometry, UnconnectedAxis
from sim_devices.link.device import LinkDevice, first_boot_count
from sim_devices.link.line import Device
from sim_devices.mc3000.board import Mc3000
from sim_devices.mc3000.channel import Channel
from sim_devices.mc3000.reports import Recording
from sim_devices.motor import Motor, MotorConstants
from sim_devices.servo_amp.amplifier import Amplifier, Fault
from sim_devices.servo_amp.multidrop import AmplifierLine

__all__ = ["JOINTS", "HeadConfig", "HeadMachine"]

BOARD_LINE, AMPLIFIER_LINE = "mc3000", "servo-amps"
_BOARDS: dict[int, tuple[str | None, ...]] = {
    1: ("left_vergence", "right_vergence", "tilt"),
    2: ("pan", None, None),
}
_AMPLIFIERS = {1: "left_vergence", 2: "right_vergence", 3: "tilt", 4: "pan"}


class HeadMachine:
    """The head on a bench: a `Part` with the lines "mc3000" and "servo-amps".

    Without a seed the joints stand, and the boot counts are, as the operating system's random source has it.
    """

    def __init__(self, config: HeadConfig | None = None, seed: int | None = None) -> None:
        self.config = config = config or HeadConfig()
        source: random.Random = random.SystemRandom() if seed is None else random.Random(f"head {seed}")
        self.joints = {name: self._make_joint(name, source) for name in JOINTS}
        self.boards: dict[int, Mc3000] = {}
        self.devices: dict[int, LinkDevice] = {}
        self.channels: dict[str, Channel] = {}
        for address, names in _BOARDS.items():
            board = Mc3000([self.joints[name] if name else UnconnectedAxis() for name in names])
            self.boards[address] = board
            self.devices[address] = LinkDevice(
                address, board, boot_count=first_boot_count(seed, address), power_up=0.0
            )
            for wired, channel in zip(names, board.channels, strict=True):
                if wired:
                    self.channels[wired] = channel
        self.amplifiers: dict[str, Amplifier] = {}
        for number, name in _AMPLIFIERS.items():
            amplifier = Amplifier(number, name.replace("_", " "), self.joints[name])
            amplifier.on_fault = self.channels[name].set_fault_input
            self.amplifiers[name] = amplifier
        self._joint_of = {amplifier.address: name for name, amplifier in self.amplifiers.items()}
        self.amplifier_line = AmplifierLine(
            [self.amplifiers[name] for name in _AMPLIFIERS.values()], self._settle_amplifier
        )
        self.t = 0.0
        self.verbs: Mapping[str, Callable[..., Any]] = HeadIncidents(self).verbs()

    def _make_joint(self, name: str, source: random.Random) -> Joint:
        config = self.config
        joint: JointConfig = getattr(config, name)
        per_degree = joint.counts_per_radian * radians(1.0)
        sign = -1 if joint.mirrored else 1
        switch_deg = config.switch_deg(name)
        drawn = source.uniform(-switch_deg, switch_deg)
        start_deg = config.start_deg.get(name, drawn)
        constants = MotorConstants(
            time_constant=joint.time_constant_ms / 1000,
            gain=joint.gain,
            counts_per_radian=joint.counts_per_radian,
            amplifier_gain=joint.amplifier_gain,
            resistance=config.resistance,
            friction_counts=config.friction_counts,
        )
        geometry = JointGeometry(
            stop=joint.stop_deg * per_degree,
            switch=switch_deg * per_degree,
            edge=sign * joint.sensor_edge_deg * per_degree,
            sign=sign,
            half_backlash=config.backlash_deg * per_degree / 2,
        )
        motor = Motor(constants, config.bus_voltage, config.peak_current, config.continuous_current)
        return Joint(motor, geometry, sign * start_deg * per_degree, config.foldback_s)

    # A part of the bench

    def power_up(self, t: float) -> None:
        """Switch boards and amplifiers on at t."""
        self.t = t
        for device in self.devices.values():
            device.power_up(t)
        for amplifier in self.amplifiers.values():
            amplifier.power_up()

    def lines(self) -> dict[str, Sequence[Device]]:
        """Both boards on one line, the four amplifiers on the other."""
        return {BOARD_LINE: list(self.devices.values()), AMPLIFIER_LINE: [self.amplifier_line]}

    def advance_to(self, t: float) -> None:
        """Run everything to t."""
        self.t = max(self.t, t)
        for address, device in self.devices.items():
            device.advance_to(t)
            self.boards[address].settle(t)

    def joint_angles(self, t: float) -> dict[str, float]:
        """Return the true joint angles at t, rad."""
        self.advance_to(t)
        return {name: self.joints[name].angle for name in JOINTS}

    def state(self) -> dict[str, Any]:
        """Return the truth about every joint: rad, rad/s, A; switches by counts; motor command −128..127."""
        return {
            "joints": {name: self._joint_state(name) for name in JOINTS},
            "boards": {
                str(address): {"boot_count": device.boot_count, "emergency_stop": self._stopped(address)}
                for address, device in self.devices.items()
            },
        }

    def _stopped(self, address: int) -> bool:
        return self.boards[address].channels[0].emergency

    def _joint_state(self, name: str) -> dict[str, Any]:
        joint, channel, amplifier = self.joints[name], self.channels[name], self.amplifiers[name]
        motor = joint.motor
        return {
            "angle": joint.angle,
            "velocity": joint.geometry.sign * joint.w / motor.constants.counts_per_radian,
            "current": motor.current(joint.w),
            "negative_switch": joint.negative_closed,
            "positive_switch": joint.positive_closed,
            "sensor": joint.sensor,
            "motor_command": motor.command,
            "mode": channel.mode,
            "actual_counts": channel.chip.actual,
            "command_counts": channel.chip.command,
            "inputs": channel.inputs,
            "bridge": motor.bridge.value,
            "faults": [fault.name for fault in Fault if fault in amplifier.latched],
            "bus_voltage": motor.bus_volts,
        }

    @contextmanager
    def record(self, axis: str) -> Iterator[Recording]:
        """Record every sample of an axis: `with machine.record("pan") as recording: …`."""
        channel = self.channel(axis)
        channel.advance_to(max(board.t for board in self.boards.values()))
        channel.recording = recording = Recording()
        try:
            yield recording
        finally:
            channel.recording = None

    def channel(self, axis: str) -> Channel:
        """Return the board's channel of a joint; raises ValueError."""
        if axis not in self.channels:
            raise ValueError(f"no axis {axis!r}; there are {', '.join(JOINTS)}")
        return self.channels[axis]

    def at_present(self, axis: str) -> tuple[Channel, Joint, Amplifier]:
        """Return what belongs to an axis, run to the present; raises ValueError."""
        channel = self.channel(axis)
        channel.settle(self.t)
        return channel, self.joints[axis], self.amplifiers[axis]

    def _settle_amplifier(self, amplifier: Amplifier, t: float) -> None:
        channel = self.channels[self._joint_of[amplifier.address]]
        channel.settle(t)

    def board(self, address: int) -> Mc3000:
        """Return a board, run to the present; raises ValueError."""
        if address not in self.boards:
            raise ValueError(f"no board {address}; there are {', '.join(map(str, self.boards))}")
        board = self.boards[int(address)]
        board.advance_to(self.t)
        return board
