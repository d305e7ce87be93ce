"""The three-axis board: every operation of its page, in counts and samples."""

from medusa.errors import CommandError
from medusa.mc3000.board import messages
from medusa.mc3000.board.messages import Latched, Operation, Settings, Snapshot
from medusa.mc3000.board.profile import Profile
from medusa.mc3000.board.registers import (
    MOVING,
    POSITION_MAX,
    POSITION_MIN,
    Filter,
    Inputs,
    LatchSource,
    Mode,
    Register,
    decode_position24,
    encode_position24,
)
from medusa.mc3000.board.session import FRAME_OVERHEAD, WHOLE_BOARD, BoardSession

MAX_REGISTERS = 8


class Board(BoardSession):
    """One MC3000 behind a session; a refusal is a CommandError with the board's status: nothing moved."""

    async def read(self, axis: int, register: int, count: int = 1) -> bytes:
        """`count` (1–8) registers from `register` on; a READ that covers 14H latches the position first."""
        if not 1 <= count <= MAX_REGISTERS:
            raise CommandError(f"READ takes 1 to {MAX_REGISTERS} registers, not {count}")
        asked = messages.encode_read(register, count)
        return await self._read(Operation.READ, axis, asked, reply_size=count)

    async def write(self, axis: int, register: int, values: bytes) -> None:
        """Write 1–8 bytes into ascending registers; the board holds them to the named operations' rules."""
        if not 1 <= len(values) <= MAX_REGISTERS:
            raise CommandError(f"WRITE takes 1 to {MAX_REGISTERS} bytes, not {len(values)}")
        touched = range(register, register + len(values))
        idle = register == Register.PROGRAM_COUNTER and values in (b"\x00", b"\x01")
        await self._request(
            Operation.WRITE,
            axis,
            messages.encode_write(register, values),
            moves=not idle and any(address in MOVING for address in touched),
            stops=idle,
        )

    async def read_position24(self, axis: int, register: Register) -> int:
        """The 24-bit position in three registers, in the order in which this triple is stored."""
        data = await self.read(axis, register, 3)
        return decode_position24(data, lsb_first=register == Register.FINAL_POSITION_LSB)

    async def write_position24(self, axis: int, register: Register, counts: int) -> None:
        """Write a 24-bit position into three registers, in the order in which this triple is stored."""
        data = encode_position24(counts, lsb_first=register == Register.FINAL_POSITION_LSB)
        await self.write(axis, register, data)

    async def position(self, axis: int) -> int:
        """Actual position, counts."""
        return (await self._ask(Operation.POSITION, axis))["actual"]

    async def command(self, axis: int, position: int) -> None:
        """Step the command position (counts, 24 bits); position mode only."""
        check_position(position)
        await self._request(
            Operation.COMMAND,
            axis,
            _payload(Operation.COMMAND, position=position),
            moves=True,
        )

    async def snapshot(self) -> Snapshot:
        """All axes at one instant."""
        return (await self.timed_snapshot())[0]

    async def timed_snapshot(self) -> tuple[Snapshot, float]:
        """All axes at one instant, and that instant on the loop's clock, s."""
        reply = await self._read(Operation.SNAPSHOT)
        snapshot = messages.decode_snapshot(reply)
        wire = (len(reply) + FRAME_OVERHEAD) * self._seconds_per_byte
        return snapshot, self.clock.update(snapshot.time_us, self.heard, wire)

    async def filter(self, axis: int, filter_: Filter) -> None:
        """Write the filter's four bytes."""
        payload = _payload(Operation.FILTER, A=filter_.A, B=filter_.B, K=filter_.K, T=filter_.T)
        await self._request(Operation.FILTER, axis, payload)

    async def read_filter(self, axis: int) -> Filter:
        """The filter's four bytes as the chip holds them."""
        a, b, k = await self.read(axis, Register.FILTER_ZERO, 3)
        (t,) = await self.read(axis, Register.SAMPLE_TIMER)
        return Filter(a, b, k, t)

    async def mode(self, axis: int, mode: Mode, *, orderly: bool = False) -> None:
        """Enter a control mode, or go idle; idle withdraws unanswered motion, or `orderly` waits for it."""
        payload = _payload(Operation.MODE, mode=mode)
        idle = mode is Mode.IDLE
        while idle and orderly and self._motions:
            await self._motions_answered.wait()
        await self._request(Operation.MODE, axis, payload, moves=not idle, stops=idle)

    async def velocity(self, axis: int, velocity: int) -> None:
        """Command velocity: 1/16 count/sample in mode 2, counts/sample in mode 3."""
        payload = _payload(Operation.VELOCITY, velocity=velocity)
        await self._request(Operation.VELOCITY, axis, payload, moves=True)

    async def profile(self, axis: int, profile: Profile) -> None:
        """Acceleration and maximum velocity of profiles and of the integral velocity mode."""
        payload = _payload(
            Operation.PROFILE, acceleration_256=profile.acceleration_256, maximum=profile.maximum
        )
        await self._request(Operation.PROFILE, axis, payload)

    async def read_profile(self, axis: int) -> Profile:
        """Acceleration and maximum velocity as the chip holds them."""
        low, high, maximum = await self.read(axis, Register.ACCELERATION_LSB, 3)
        return Profile(low | high << 8, maximum)

    async def move(self, axis: int, final: int, *, start: bool = True) -> None:
        """Run a trapezoid to `final` (counts), or arm it for START."""
        check_position(final)
        payload = _payload(Operation.MOVE, final=final, start=int(start))
        await self._request(Operation.MOVE, axis, payload, moves=True)

    async def start(self, mask: int) -> None:
        """Begin all armed moves of the axis mask in the same sample."""
        payload = _payload(Operation.START, mask=mask)
        await self._request(Operation.START, payload=payload, moves=True)

    async def preset(self, axis: int, actual: int) -> None:
        """Set the actual position (counts); idle only, and it clears the mark in 18H–1BH."""
        check_position(actual)
        await self._request(Operation.PRESET, axis, _payload(Operation.PRESET, actual=actual))

    async def inputs(self, axis: int) -> Inputs:
        """The axis' inputs and latches."""
        return Inputs((await self._ask(Operation.INPUTS, axis))["inputs"])

    async def latch(self, axis: int, source: LatchSource) -> None:
        """Arm the one-shot position latch for an edge, or disarm it."""
        await self._request(Operation.LATCH, axis, _payload(Operation.LATCH, source=source))

    async def latched(self, axis: int) -> Latched:
        """What the latch caught."""
        fields = await self._ask(Operation.LATCHED, axis)
        return Latched(
            messages.known(LatchSource, fields["source"]),
            bool(fields["caught"]),
            fields["position"],
            fields["time_us"],
        )

    async def limit_enable(self, axis: int, enable: bool) -> None:
        """Let the limit switches drive the chip's LIMIT input, or not (idle only)."""
        payload = _payload(Operation.LIMIT_ENABLE, enable=int(enable))
        await self._request(Operation.LIMIT_ENABLE, axis, payload)

    async def following(self, axis: int, limit: int) -> None:
        """Following-error limit, counts; 0 switches the supervision off."""
        await self._request(Operation.FOLLOWING, axis, _payload(Operation.FOLLOWING, limit=limit))

    async def stop(self, axis: int = WHOLE_BOARD, *, orderly: bool = False) -> None:
        """Stop one axis or all by their ramps; never refused. Confirm it by reading back.

        A stop withdraws every unanswered motion of the board; an orderly one, a procedure's step, waits for it.
        """
        while orderly and self._motions:
            await self._motions_answered.wait()
        await self._request(Operation.STOP, axis, stops=True, urgent=True)

    async def settings(self, axis: int) -> Settings:
        """Mode, following limit, limit enable and armed move as the board holds them."""
        fields = await self._ask(Operation.SETTINGS, axis)
        return Settings(
            messages.known(Mode, fields["mode"]),
            fields["following_limit"],
            bool(fields["limit_enable"]),
            bool(fields["armed"]),
        )

    async def read_mark(self, axis: int) -> bytes:
        """The four bytes of 18H–1BH, zero unless a host wrote them since the count was last void."""
        return await self.read(axis, Register.MARK, 4)

    async def write_mark(self, axis: int, mark: bytes) -> None:
        """Write the four bytes of 18H–1BH."""
        await self.write(axis, Register.MARK, mark)


def _payload(operation: Operation, **fields: int) -> bytes:
    try:
        return messages.encode_request(operation, **fields)
    except ValueError as error:
        raise CommandError(str(error), operation=operation) from None


def check_position(counts: int) -> None:
    """Raise CommandError when a position does not fit the chip's 24 bits."""
    if not POSITION_MIN <= counts <= POSITION_MAX:
        raise CommandError(f"position {counts} counts is outside {POSITION_MIN}..{POSITION_MAX}")
