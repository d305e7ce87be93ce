"""What can be done to the emulated head from outside, and how it can break: the verbs of `inject`."""

from collections.abc import Callable
from math import degrees
from typing import Any, Protocol

from sim_devices.head_config import JOINTS
from sim_devices.joint import Joint
from sim_devices.link.device import LinkDevice
from sim_devices.mc3000.board import Mc3000
from sim_devices.mc3000.channel import Channel
from sim_devices.servo_amp.amplifier import Amplifier, Fault


class HeadParts(Protocol):
    """What the incidents reach of a head: its boards, and an axis' parts run to the present."""

    boards: dict[int, Mc3000]
    devices: dict[int, LinkDevice]
    t: float

    def at_present(self, axis: str) -> tuple[Channel, Joint, Amplifier]: ...

    def board(self, address: int) -> Mc3000: ...


class HeadIncidents:
    """Each method acts at the present instant and raises ValueError on an argument that there is not."""

    def __init__(self, head: HeadParts) -> None:
        self._head = head

    def verbs(self) -> dict[str, Callable[..., Any]]:
        """Return every verb by its name."""
        return {
            verb.__name__: verb
            for verb in (
                self.amplifier_fault,
                self.user_inhibit,
                self.encoder_loss,
                self.sensor,
                self.switch,
                self.stop_input,
                self.emergency_stop,
                self.restart_board,
                self.restart_amplifier,
                self.bus_voltage,
                self.current_limits,
                self.place,
            )
        }

    def amplifier_fault(self, axis: str, fault: str = "over_temperature", on: bool = True) -> None:
        """Let the cause of an amplifier's fault appear or go."""
        amplifier = self._head.at_present(axis)[2]
        causes = {each.name.lower(): each for each in Fault if each.name}
        if fault not in causes:
            raise ValueError(f"no fault {fault!r}; there are {', '.join(causes)}")
        amplifier.set_cause(causes[fault], on)

    def user_inhibit(self, axis: str, on: bool = True) -> None:
        """Operate the inhibit input of an amplifier."""
        self._head.at_present(axis)[2].set_user_inhibit(on)

    def encoder_loss(self, axis: str, at: str = "board", on: bool = True) -> None:
        """Pull or plug an encoder at the board, the amplifier or both."""
        channel, _, amplifier = self._head.at_present(axis)
        if at not in ("board", "amplifier", "both"):
            raise ValueError(f"encoder at {at!r}; there are board, amplifier, both")
        if at != "amplifier":
            channel.set_encoder_lost(on)
        if at != "board":
            amplifier.set_encoder_lost(on)

    def sensor(self, axis: str, stuck: str) -> None:
        """Let a home sensor be stuck "on" or "off", or set it "free"."""
        joint = self._head.at_present(axis)[1]
        joint.forced_sensor = _level("stuck", stuck, "on", "off")
        joint.refresh()

    def switch(self, axis: str, side: str, held: str) -> None:
        """Hold the "negative" or "positive" limit switch (by counts) "closed" or "open", or set it "free"."""
        channel, joint, _ = self._head.at_present(axis)
        level = _level("held", held, "closed", "open")
        if side == "negative":
            joint.forced_negative = level
        elif side == "positive":
            joint.forced_positive = level
        else:
            raise ValueError(f"side {side!r}; there are negative, positive")
        joint.refresh()
        channel.update_limit()

    def stop_input(self, axis: str, on: bool = True) -> None:
        """Pull the STOP pin of an axis's chip low, or let it go."""
        self._head.at_present(axis)[0].set_stop_input(on)

    def emergency_stop(self, board: int | None = None) -> None:
        """Press the emergency stop of one board or of both; it latches there."""
        for address in self._head.boards if board is None else (board,):
            self._head.board(address).emergency_stop()

    def restart_board(self, board: int) -> None:
        """Cycle the power of a board."""
        self._head.board(board)
        self._head.devices[int(board)].restart(self._head.t)

    def restart_amplifier(self, axis: str) -> None:
        """Cycle the power of an amplifier."""
        self._head.at_present(axis)[2].power_up()

    def bus_voltage(self, volts: float, axis: str | None = None) -> None:
        """Change the bus voltage of one amplifier or of all."""
        for name in JOINTS if axis is None else (axis,):
            self._head.at_present(name)[2].set_bus(volts)

    def current_limits(self, peak: float, continuous: float, axis: str | None = None) -> None:
        """Change the current limits of one amplifier or of all, in A."""
        for name in JOINTS if axis is None else (axis,):
            joint = self._head.at_present(name)[1]
            joint.motor.set_currents(peak, continuous)
            joint.refresh()

    def place(self, axis: str, angle: float) -> None:
        """Put a joint at an angle in rad by hand, between its stops; the encoder counts along."""
        channel, joint, _ = self._head.at_present(axis)
        stop = joint.geometry.stop / joint.motor.constants.counts_per_radian
        if not -stop < angle < stop:
            raise ValueError(f"angle is {degrees(angle):.2f}°, the stops are at ±{degrees(stop):.2f}°")
        joint.place(joint.geometry.sign * angle * joint.motor.constants.counts_per_radian)
        channel.take_counts()
        channel.update_limit()


def _level(name: str, value: str, high: str, low: str) -> bool | None:
    levels = {high: True, low: False, "free": None}
    if value not in levels:
        raise ValueError(f"{name} is {value!r}; there are {', '.join(levels)}")
    return levels[value]
