"""The amplifiers' common line: every command is seen by all, answered by the one it names."""

from collections.abc import Callable, Sequence
from math import inf

from sim_devices.servo_amp.amplifier import COMPLETE, INVALID, Amplifier
from sim_devices.servo_amp.frame import READ, WRITE, Command, CommandReceiver, encode_reply

BROADCAST = 0
GAP_S = 0.010
DATA_CRC_ERROR = 8


class AmplifierLine:
    """Amplifiers on one line, as a `Device`; `advance_joint(joint's amplifier, t)` runs what drives it."""

    send: Callable[[bytes, float], None]

    def __init__(
        self, amplifiers: Sequence[Amplifier], settle: Callable[[Amplifier, float], None], baud: int = 115200
    ) -> None:
        self.amplifiers = tuple(amplifiers)
        self.send = lambda data, t: None
        self._settle = settle
        self._receiver = CommandReceiver(GAP_S, 10 / baud)

    def receive(self, data: bytes, t: float) -> None:
        """Take bytes of which the last has arrived at t."""
        for command in self._receiver.feed(data, t):
            for amplifier in self.amplifiers:
                if command.address in (amplifier.address, BROADCAST):
                    self._settle(amplifier, t)
                    self._carry_out(amplifier, command, t)

    def advance_to(self, t: float) -> None:
        """Let the watchdogs expire that are due."""
        for amplifier in self.amplifiers:
            if amplifier.joint.due <= t:
                self._settle(amplifier, t)

    def next_due(self) -> float | None:
        """Return when the first watchdog expires, or None."""
        due = min((amplifier.joint.due for amplifier in self.amplifiers), default=inf)
        return None if due == inf else due

    def _carry_out(self, amplifier: Amplifier, command: Command, t: float) -> None:
        status, data = execute(amplifier, command)
        if command.address == BROADCAST:
            return
        if status == COMPLETE:
            amplifier.feed(t)
        self.send(encode_reply(command.sequence, status, data), t)


def execute(amplifier: Amplifier, command: Command) -> tuple[int, bytes]:
    """Carry a command out; return status1 and the reply's data. Of several errors the first of 8, 6, 4."""
    if command.data is None:
        return DATA_CRC_ERROR, b""
    if command.kind & WRITE:
        status = amplifier.write(command.index, command.offset, command.data)
        if status != COMPLETE:
            return status, b""
    if command.kind & READ:
        data = amplifier.read(command.index, command.offset, command.words)
        return (INVALID, b"") if data is None else (COMPLETE, data)
    return (COMPLETE, b"") if command.kind & WRITE else (INVALID, b"")
