"""The head: four joints on two boards and four amplifiers, as one machine."""

import asyncio
import logging
from collections.abc import AsyncIterator, Iterable, Mapping
from contextlib import asynccontextmanager
from typing import Literal

from medusa.completion import complete
from medusa.errors import CommandError, MedusaError, ProtocolError
from medusa.head.fault_reaction import FaultWatch
from medusa.head.faults import FaultHub
from medusa.head.moves import MoveReport, Moves, Speeds
from medusa.head.snapshots import HeadSnapshot, SnapshotReader
from medusa.head.stopping import Stopping
from medusa.head.supervision import Supervision
from medusa.link import Line, Trace
from medusa.mc3000.amplifiers import Bridges
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, Inputs, Mode, WatchdogAction
from medusa.mc3000.config import AXIS_NAMES, CHIP_CLOCK_HZ, HeadConfig
from medusa.mc3000.homing.homing import HomingResult, home_head
from medusa.mc3000.homing.mark import NO_MARK, make_mark, name_of_port
from medusa.mc3000.joint import VELOCITY_MODES
from medusa.servo_amp import Amplifier, AmplifierLine

log = logging.getLogger(__name__)

WATCHDOG_ACTIONS = {"idle": WatchdogAction.IDLE, "ramp": WatchdogAction.STOP}
FEEDBACK_ERROR = "feedback error"
LATCHES_THAT_BAR = {
    Inputs.EMERGENCY_STOP_LATCHED: "an emergency stop",
    Inputs.FAULT_LATCHED: "an amplifier fault",
}


class Head:
    """A head on open lines; `Head.open` makes one. Connecting, reconnecting and failing move nothing."""

    def __init__(
        self,
        config: HeadConfig,
        line: Line,
        amplifier_line: AmplifierLine | None = None,
        *,
        port_name: str = "",
    ) -> None:
        self.config = config
        self.line = line
        self.port_name = port_name
        self.boards = {
            address: Board(line.session(address), baud=config.ports.baud)
            for address in config.board_addresses
        }
        self.axes = {
            name: Axis(name, config.axis(name), self.boards[config.axis(name).board]) for name in AXIS_NAMES
        }
        self.amplifiers: dict[str, Amplifier] = {}
        if amplifier_line is not None:
            self.amplifiers = {
                name: amplifier_line.amplifier(config.axis(name).amplifier) for name in AXIS_NAMES
            }
        self.faults = FaultHub()
        self._reader = SnapshotReader(self.axes, self.boards)
        self._stopping = Stopping(self.axes, self.boards, line, config)
        self._bridges = Bridges(self.amplifiers, self._stopping, config.safety.amplifier_watchdog_ms)
        self._supervision = Supervision(
            self.axes, self.boards, self.amplifiers, self._reader, self.faults, config
        )
        self._watch = FaultWatch(self.axes, self.boards, self.amplifiers, self.faults, self._stopping)
        self._moves = Moves(self.axes, self.boards, self._reader, self.faults, self.stop, self._watch.stopped)

    @property
    def enabled(self) -> frozenset[str]:
        """Joints whose bridges this host has switched on."""
        return self._bridges.on

    @classmethod
    @asynccontextmanager
    async def open(
        cls,
        config: HeadConfig,
        boards: str | None = None,
        amps: str | Literal[False] | None = None,
        trace: Trace | None = None,
        *,
        port_name: str | None = None,
        seed: int | None = None,
    ) -> AsyncIterator["Head"]:
        """Connect to a head and leave it stopped, idle and with its bridges inhibited at the end.

        Paths not given are the configuration's; without any for the amplifiers, or with False, the head can be
        looked at and stopped, not enabled. `port_name` stands for the boards' path in homing marks and in the
        record of checks. Raises PortError and what the link raises; at the end DeviceFault when the head cannot
        be confirmed at rest.
        """
        path = boards or config.ports.boards
        if path is None:
            raise CommandError("no port for the boards: give one, or set ports.boards in the configuration")
        name = port_name or name_of_port(path)
        amps_path = config.ports.amplifiers if amps is None else amps or None
        baud = config.ports.baud
        async with Line(path, baud=baud, trace=trace, name="boards", seed=seed) as line:
            if amps_path is None:
                head = cls(config, line, port_name=name)
                async with head._connected():
                    yield head
                return
            async with AmplifierLine(amps_path, baud=baud, trace=trace) as amplifiers:
                head = cls(config, line, amplifiers, port_name=name)
                async with head._connected():
                    yield head

    @asynccontextmanager
    async def _connected(self) -> AsyncIterator[None]:
        try:
            await asyncio.gather(*(board.open() for board in self.boards.values()))
            for address, board in self.boards.items():
                if board.clock_hz != CHIP_CLOCK_HZ:
                    raise ProtocolError(
                        f"board {address:02X}H: its chips run at {board.clock_hz} Hz, not at {CHIP_CLOCK_HZ} Hz, for"
                        " which the configuration's speeds were checked"
                    )
            await self._recall_homing()
            yield
        except BaseException as ended:
            # What ended the context is told; what then kept the head from being confirmed at rest, as its note.
            try:
                await complete(self._close())
            except MedusaError as error:
                log.error("%s", error)
                if str(error) not in str(ended):
                    ended.add_note(f"the head could not be confirmed at rest: {error}")
            raise
        else:
            await complete(self._close())

    async def _close(self) -> None:
        try:
            if self.enabled:
                await self.stop()
                await self.disable()
        finally:
            await self._supervision.end()
            self._watch.close()

    async def enable(self, names: Iterable[str] | None = None, *, mode: Mode = Mode.POSITION) -> None:
        """Switch watchdogs and bridges on while the axes are idle, then enter `mode`, where they stand.

        A joint whose limit is latched stays idle: homing backs it off. Raises DeviceFault naming the joint
        whose amplifier does not enable, CommandError while something else is latched.
        """
        wanted = self._names(names)
        if not self.amplifiers:
            raise CommandError("no port for the amplifiers was given, so no bridge can be enabled")
        for board in self.boards.values():
            if not board.may_move:
                await board.open()
        await self._recall_homing()
        snapshot = await self.snapshot()
        for name in wanted:
            for bit, what in LATCHES_THAT_BAR.items():
                if snapshot.joints[name].inputs & bit:
                    raise CommandError(f"{name}: {what} is latched; clear it first")
        await self._watchdogs_on()
        new = [name for name in wanted if not await self._bridges.is_on(name)]
        try:
            for name in new:
                if self.axes[name].mode is not Mode.IDLE:
                    await self.axes[name].set_mode(Mode.IDLE)
                await self._bridges.switch_on(name)
            if mode is not Mode.IDLE:
                free = [n for n in wanted if not snapshot.joints[n].inputs & Inputs.LIMIT_LATCHED]
                await asyncio.gather(*(self.axes[name].set_mode(mode) for name in free))
                for name in set(wanted) - set(free):
                    log.warning("%s: its limit is latched; it stays idle until homing backs it off", name)
        except BaseException:
            await complete(self._give_up(new))
            raise
        log.info("enabled: %s", ", ".join(wanted))

    async def _give_up(self, names: list[str]) -> None:
        """Disable as far as that goes; what kept the head from being enabled is told, not what follows."""
        try:
            await self.disable(names)
        except MedusaError as error:
            log.error("%s", error)

    async def _watchdogs_on(self) -> None:
        safety = self.config.safety
        action = WATCHDOG_ACTIONS[safety.board_watchdog_action]
        await asyncio.gather(
            *(board.watchdog(safety.board_watchdog_ms, action) for board in self.boards.values())
        )
        self._supervision.start()

    async def disable(self, names: Iterable[str] | None = None) -> None:
        """End motions by their ramps, go idle, wait for rest, inhibit the bridges.

        The watchdogs end with the last joint. Raises DeviceFault naming the joints that do not come to rest;
        their bridges stay on and brake them.
        """
        wanted = [name for name in self._names(names) if name in self.enabled]
        if self._moves.is_running(wanted):
            await self.stop()
        await asyncio.gather(*(self.axes[name].brake() for name in wanted if self.axes[name].may_ramp))
        await asyncio.gather(*(self.axes[name].set_mode(Mode.IDLE) for name in wanted))
        await self._bridges.switch_off(wanted)
        if not self.enabled:
            await self._supervision.end()
            await asyncio.gather(*(board.watchdog(0) for board in self.boards.values()))
            log.info("disabled: every bridge inhibited at rest")

    async def home(self, names: Iterable[str] | None = None) -> dict[str, HomingResult]:
        """Home the named joints (default: all) in the configured order; enables them first.

        Raises HomingError with its named failure, the joint left disabled; CommandError for a joint that was
        not checked since its configuration changed.
        """
        return await home_head(self, self._names(names))

    async def move(
        self, targets: Mapping[str, float], speeds: Mapping[str, Speeds] | None = None
    ) -> MoveReport:
        """Move joints together to angles (rad) and wait until they rest; see `Moves.run`.

        A joint in a velocity mode comes to rest by its ramp and enters position mode first.
        """
        axes = [self.axes[name] for name in self._names(targets)]
        await asyncio.gather(*(a.set_mode(Mode.POSITION) for a in axes if a.mode in VELOCITY_MODES))
        return await self._moves.run(targets, speeds)

    async def velocity(self, velocities: Mapping[str, float]) -> dict[str, float]:
        """Command velocities (rad/s) at once; those taken. A joint in no velocity mode enters mode 3."""

        async def one(name: str, velocity: float) -> float:
            axis = self.axes[name]
            if axis.mode not in VELOCITY_MODES:
                if axis.mode is Mode.IDLE:
                    raise CommandError(f"{name}: is idle; enable it first")
                await axis.set_mode(Mode.INTEGRAL_VELOCITY)
            return await axis.velocity(velocity)

        names = self._names(velocities)
        taken = await asyncio.gather(*(one(name, velocities[name]) for name in names))
        return dict(zip(names, taken, strict=True))

    async def stop(self) -> None:
        """Stop every joint by its ramp, confirmed by reading back; DeviceFault names what is not."""
        self._moves.interrupt("the head was stopped on the way")
        await self._stopping.stop()

    async def emergency_stop(self) -> None:
        """Idle everything at once and latch it, confirmed by reading back; `clear` releases it."""
        self._moves.interrupt("the head was stopped on the way by an emergency stop")
        self._watch.emergency = True
        await self._stopping.emergency_stop()

    async def clear(self) -> dict[str, Inputs]:
        """Release what is latched and whose cause is gone; by joint what remains. Moves nothing."""
        self._moves.forget_armed()
        await self._bridges.clear()
        await asyncio.gather(*(board.clear() for board in self.boards.values()))
        self._watch.emergency = False
        latches = Inputs.LIMIT_LATCHED | Inputs.EMERGENCY_STOP_LATCHED | Inputs.FAULT_LATCHED
        snapshot = await self.snapshot()
        return {n: j.inputs & latches for n, j in snapshot.joints.items() if j.inputs & latches}

    async def stopped_by_fault(self) -> str:
        """Wait until the stop that the last fault caused has ended; what there is to tell of it."""
        return await self._watch.stopped()

    async def rest(self, names: Iterable[str] | None = None) -> None:
        """Wait until the named joints stand; DeviceFault names those that do not in time."""
        await self._stopping.stand(self._names(names))

    async def park(self) -> MoveReport:
        """Move to the park angles, then go idle and inhibit the bridges."""
        for axis in self.axes.values():
            await axis.set_mode(Mode.POSITION)
        report = await self.move({name: axis.config.park_angle for name, axis in self.axes.items()})
        await self.disable()
        return report

    async def snapshot(self) -> HeadSnapshot:
        """The state of all joints now."""
        return await self._reader.read()

    def snapshots(self, rate_hz: float) -> AsyncIterator[HeadSnapshot]:
        """The state of all joints at a fixed rate, for `async for`."""
        return self._reader.stream(rate_hz)

    def _names(self, names: Iterable[str] | None) -> list[str]:
        chosen = list(AXIS_NAMES if names is None else names)
        for name in chosen:
            if name not in self.axes:
                raise CommandError(f"there is no joint {name!r}; the head has {', '.join(AXIS_NAMES)}")
        return chosen

    def mark(self, name: str) -> bytes:
        """The homing mark that a joint homed on this machine, with this configuration, carries."""
        axis = self.axes[name]
        return make_mark(self.port_name, name, axis.config, axis.board.boot_count)

    async def _recall_homing(self) -> None:
        """Believe the marks that the boards carry, unless an amplifier lost its feedback or is not heard."""
        for name, axis in self.axes.items():
            axis.homed = False
            mark = await axis.board.read_mark(axis.channel)
            if mark == NO_MARK or name not in self.amplifiers:
                continue
            try:
                status = await self.amplifiers[name].status()
            except MedusaError as error:
                log.warning("%s: whether it is homed is not known: %s", name, error)
                continue
            if FEEDBACK_ERROR in status.system_protection:
                log.warning("%s: its amplifier lost the feedback; homing is void", name)
                await axis.board.write_mark(axis.channel, NO_MARK)
            else:
                axis.homed = mark == self.mark(name)
