"""The three-axis board: every operation of its page, in counts and samples."""

from medusa.errors import CommandError
from medusa.link.messages import WHOLE_DEVICE
from medusa.mc3000.board import messages
from medusa.mc3000.board import operations as op
from medusa.mc3000.board.messages import Latched, Settings, Snapshot
from medusa.mc3000.board.profile import Profile
from medusa.mc3000.board.registers import (
    POSITION_MAX,
    POSITION_MIN,
    FilterBytes,
    Inputs,
    LatchSource,
    Mode,
    Register,
    decode_position24,
    encode_position24,
)
from medusa.mc3000.board.session import FRAME_OVERHEAD, BoardSession

MAX_REGISTERS = 8


class Board(BoardSession):
    """One MC3000 behind a session.

    Every method raises CommandError for a refusal (`status`: the board's; nothing moved), NoReply and PortError.
    """

    async def read(self, axis: int, register: int, count: int = 1) -> bytes:
        """`count` (1–8) registers from `register` on; a READ that covers 14H latches the position first."""
        if not 1 <= count <= MAX_REGISTERS:
            raise CommandError(f"READ takes 1 to {MAX_REGISTERS} registers, not {count}")
        return await self._read(op.READ, axis, op.READ.request.pack(register, count), reply_size=count)

    async def write(self, axis: int, register: int, values: bytes) -> None:
        """Write 1–8 bytes into ascending registers; the board holds them to the named operations' rules."""
        if not 1 <= len(values) <= MAX_REGISTERS:
            raise CommandError(f"WRITE takes 1 to {MAX_REGISTERS} bytes, not {len(values)}")
        operation = op.write_of(register, values)
        await self._request(operation, axis, operation.request.pack(register) + values)

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
        return messages.decode_position(await self._read(op.POSITION, axis))

    async def command(self, axis: int, position: int) -> None:
        """Step the command position (counts, 24 bits); position mode only."""
        check_position(position)
        await self._request(op.COMMAND, axis, op.COMMAND.request.pack(position))

    async def snapshot(self) -> Snapshot:
        """All axes at one instant."""
        return (await self.timed_snapshot())[0]

    async def timed_snapshot(self) -> tuple[Snapshot, float]:
        """All axes at one instant, and that instant on the loop's clock, s."""
        reply = await self._read(op.SNAPSHOT)
        snapshot = messages.decode_snapshot(reply)
        wire = (len(reply) + FRAME_OVERHEAD) * self._seconds_per_byte
        return snapshot, self.clock.update(snapshot.time_us, self.received_at, wire)

    async def filter(self, axis: int, filter_: FilterBytes) -> None:
        """Write the filter's four bytes."""
        payload = op.FILTER.request.pack(filter_.A, filter_.B, filter_.K, filter_.T)
        await self._request(op.FILTER, axis, payload)

    async def read_filter(self, axis: int) -> FilterBytes:
        """The filter's four bytes as the chip holds them."""
        a, b, k = await self.read(axis, Register.FILTER_ZERO, 3)
        (t,) = await self.read(axis, Register.SAMPLE_TIMER)
        return FilterBytes(a, b, k, t)

    async def mode(self, axis: int, mode: Mode, *, after_pending: bool = False) -> None:
        """Enter a control mode, or go idle; idle withdraws unanswered motion, or waits for it `after_pending`."""
        operation = op.mode_of(mode)
        while operation.stops and after_pending and self._motions:
            await self._motions_answered.wait()
        await self._request(operation, axis, operation.request.pack(mode))

    async def velocity(self, axis: int, velocity: int) -> None:
        """Command velocity: 1/16 count/sample in mode 2, counts/sample in mode 3."""
        await self._request(op.VELOCITY, axis, op.VELOCITY.request.pack(velocity))

    async def profile(self, axis: int, profile: Profile) -> None:
        """Acceleration and maximum velocity of profiles and of the integral velocity mode."""
        payload = op.PROFILE.request.pack(profile.acceleration_256, profile.maximum)
        await self._request(op.PROFILE, axis, payload)

    async def read_profile(self, axis: int) -> Profile:
        """Acceleration and maximum velocity as the chip holds them."""
        low, high, maximum = await self.read(axis, Register.ACCELERATION_LSB, 3)
        return Profile(low | high << 8, maximum)

    async def move(self, axis: int, final: int, *, start: bool = True) -> None:
        """Run a trapezoid to `final` (counts), or arm it for START."""
        check_position(final)
        await self._request(op.MOVE, axis, op.MOVE.request.pack(final, start))

    async def start(self, mask: int) -> None:
        """Begin all armed moves of the axis mask in the same sample."""
        await self._request(op.START, payload=op.START.request.pack(mask))

    async def preset(self, axis: int, actual: int) -> None:
        """Set the actual position (counts); idle only, and it clears the mark in 18H–1BH."""
        check_position(actual)
        await self._request(op.PRESET, axis, op.PRESET.request.pack(actual))

    async def inputs(self, axis: int) -> Inputs:
        """The axis' inputs and latches."""
        return messages.decode_inputs(await self._read(op.INPUTS, axis))

    async def latch(self, axis: int, source: LatchSource) -> None:
        """Arm the one-shot position latch for an edge, or disarm it."""
        await self._request(op.LATCH, axis, op.LATCH.request.pack(source))

    async def latched(self, axis: int) -> Latched:
        """What the latch caught."""
        return messages.decode_latched(await self._read(op.LATCHED, axis))

    async def limit_enable(self, axis: int, enable: bool) -> None:
        """Let the limit switches drive the chip's LIMIT input, or not (idle only)."""
        await self._request(op.LIMIT_ENABLE, axis, op.LIMIT_ENABLE.request.pack(enable))

    async def following(self, axis: int, limit: int) -> None:
        """Following-error limit, counts; 0 switches the supervision off."""
        await self._request(op.FOLLOWING, axis, op.FOLLOWING.request.pack(limit))

    async def stop(self, axis: int = WHOLE_DEVICE, *, after_pending: bool = False) -> None:
        """Stop one axis or all by their ramps; never refused. Confirm it by reading back.

        A stop withdraws every unanswered motion of the board; `after_pending`, as a step of a procedure, it waits
        for them.
        """
        while after_pending and self._motions:
            await self._motions_answered.wait()
        await self._request(op.STOP, axis)

    async def settings(self, axis: int) -> Settings:
        """Mode, following limit, limit enable and armed move as the board holds them."""
        return messages.decode_settings(await self._read(op.SETTINGS, axis))

    async def read_mark(self, axis: int) -> bytes:
        """The four bytes of 18H–1BH, zero unless a host wrote them since the count was last invalid."""
        return await self.read(axis, Register.MARK, 4)

    async def write_mark(self, axis: int, mark: bytes) -> None:
        """Write the four bytes of 18H–1BH."""
        await self.write(axis, Register.MARK, mark)


def check_position(counts: int) -> None:
    """Raise CommandError when a position does not fit the chip's 24 bits."""
    if not POSITION_MIN <= counts <= POSITION_MAX:
        raise CommandError(f"position {counts} counts is outside {POSITION_MIN}..{POSITION_MAX}")
