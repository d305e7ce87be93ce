"""The MC3000 boards with their servo amplifiers as a drive: four modes, homing by sensors, marks, watchdogs."""

import asyncio
import logging
from collections.abc import Collection, Mapping
from contextlib import AsyncExitStack
from typing import Any, Literal

from medusa.completion import run_to_completion
from medusa.errors import CommandError, DeviceFault, MedusaError, NoReply, ProtocolError
from medusa.head.drive import (
    Drive,
    MoveEnds,
    MovePlan,
    Mover,
    Reading,
    Speeds,
)
from medusa.head.faults import Cause, Fault
from medusa.head.joint_group import JointGroup
from medusa.head.stopping import READ_BACK_SECONDS, Stopping
from medusa.link import Line, Trace
from medusa.mc3000.amplifiers import Amplifiers
from medusa.mc3000.arrivals import Arrivals
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, Mode, WatchdogAction
from medusa.mc3000.config import CHIP_CLOCK_HZ, Mc3000Config
from medusa.mc3000.fault_reports import INVALIDATES_HOMING, FaultReports
from medusa.mc3000.feeding import Feeding
from medusa.mc3000.homing.homing import HomingResult, home_joints
from medusa.mc3000.joint import VELOCITY_MODES
from medusa.mc3000.mark import NO_MARK, make_mark, name_of_port
from medusa.mc3000.planning import plan_move, starts
from medusa.mc3000.readings import capabilities, details_of, state_of, traits_of
from medusa.mc3000.stall_watch import StallWatch
from medusa.servo_amp import Amplifier, AmplifierLine

log = logging.getLogger(__name__)

EVENT_MARGIN_SECONDS = 0.7
"""How much later than planned "profile done" may come before the boards are asked: six sendings of an event."""
WATCHDOG_ACTIONS = {"idle": WatchdogAction.IDLE, "ramp": WatchdogAction.STOP}
FEEDBACK_ERROR = "feedback error"
LATCHES_THAT_BAR = {Cause.EMERGENCY_STOP: "an emergency stop", Cause.DRIVE: "an amplifier fault"}


class Mc3000Drive(Drive):
    """Joints on MC3000 boards.

    Paths not given are the configuration's; without any for the amplifiers, or with False, the joints can be read and
    stopped, not enabled. `port_name` stands for the boards' path in homing marks and in the record of checks.
    """

    def __init__(
        self,
        config: Mc3000Config,
        boards: str | None = None,
        amps: str | Literal[False] | None = None,
        *,
        trace: Trace | None = None,
        port_name: str | None = None,
        seed: int | None = None,
    ) -> None:
        super().__init__()
        path = boards or config.ports.boards
        if path is None:
            raise CommandError("no port for the boards: give one, or set ports.boards in the configuration")
        self.config = config
        self.port_name = port_name or name_of_port(path)
        baud = config.ports.baud
        self.line = Line(path, baud=baud, trace=trace, name="boards", seed=seed)
        amps_path = config.ports.amplifiers if amps is None else amps or None
        self._amplifier_line = None if amps_path is None else AmplifierLine(amps_path, baud=baud, trace=trace)
        self.boards = {
            address: Board(self.line.session(address), baud=baud) for address in config.board_addresses
        }
        self.axes = {name: Axis(name, axis, self.boards[axis.board]) for name, axis in config.axes.items()}
        self.amplifiers: dict[str, Amplifier] = {}
        if self._amplifier_line is not None:
            self.amplifiers = {
                name: self._amplifier_line.amplifier(axis.amplifier) for name, axis in config.axes.items()
            }
        self.traits = {name: traits_of(axis) for name, axis in self.axes.items()}
        self.units = tuple(
            tuple(name for name, axis in self.axes.items() if axis.board is board)
            for board in self.boards.values()
        )
        self.can = capabilities(config)
        self.fault_reports = FaultReports(self.axes, self.boards, self.publish)
        self._stopping = Stopping(self)
        self._amplifiers = Amplifiers(self.amplifiers, self.rest, config.safety.amplifier_watchdog_ms)
        self._feeding = Feeding(
            self.axes, self.boards, self.amplifiers, self.fault_reports.report, config.safety
        )
        self._stall_watch = StallWatch(self.axes, self.fault_reports.report)
        self._open = AsyncExitStack()

    @staticmethod
    def of(group: JointGroup) -> "Mc3000Drive":
        """The drive of a head; raises CommandError when it is another one."""
        if not isinstance(group.drive, Mc3000Drive):
            raise CommandError("this needs MC3000 boards; the configured head has another drive")
        return group.drive

    @property
    def enabled(self) -> frozenset[str]:
        """Joints whose amplifiers this host has enabled."""
        return self._amplifiers.enabled

    async def open(self) -> None:
        """Open the lines and sessions; homing is recalled from the boards' marks."""
        await self._open.enter_async_context(self.line)
        if self._amplifier_line is not None:
            await self._open.enter_async_context(self._amplifier_line)
        try:
            await asyncio.gather(*(board.open() for board in self.boards.values()))
        except NoReply as error:
            error.add_note(f"is it on, and is {self.line.path} its port, at {self.config.ports.baud} baud?")
            raise
        for address, board in self.boards.items():
            if board.clock_hz != CHIP_CLOCK_HZ:
                raise ProtocolError(
                    f"board {address:02X}H: its chips run at {board.clock_hz} Hz, not at {CHIP_CLOCK_HZ} Hz, for"
                    " which the configuration's speeds were checked"
                )
        await self._recall_homing()

    async def close(self) -> None:
        """Feed no longer, and close the lines."""
        try:
            await self._feeding.end()
            await self._stall_watch.end()
            self.fault_reports.close()
        finally:
            await self._open.aclose()

    async def read(self, names: Collection[str] | None = None) -> Reading:
        """Snapshots of the boards that carry the named joints, asked at once."""
        boards = [
            board
            for unit, board in zip(self.units, self.boards.values(), strict=True)
            if names is None or not set(unit).isdisjoint(names)
        ]
        snapshots = await asyncio.gather(*(board.timed_snapshot() for board in boards))
        by_board = dict(zip(boards, snapshots, strict=True))
        joints = {}
        for name, axis in self.axes.items():
            if axis.board in by_board:
                snapshot, time = by_board[axis.board]
                axis.take_snapshot(snapshot.axes[axis.channel], time)
                joints[name] = state_of(axis, snapshot.axes[axis.channel], time)
        return Reading(min(joint.time for joint in joints.values()), joints)

    async def enable(self, names: Collection[str], *, mode: Mode = Mode.POSITION) -> None:
        """Switch watchdogs and amplifiers on while the axes are idle, then enter `mode`, where they are.

        A joint whose limit is latched stays idle: homing backs it off. Raises DeviceFault naming the joint
        whose amplifier does not enable, CommandError while something else is latched.
        """
        if not self.amplifiers:
            raise CommandError("no port for the amplifiers was given, so no joint can be enabled")
        for board in self.boards.values():
            if not board.may_move:
                await board.open()
        await self._recall_homing()
        reading = await self.read()
        for name in names:
            for cause, what in LATCHES_THAT_BAR.items():
                if cause in reading.joints[name].latched:
                    raise CommandError(f"{name}: {what} is latched; clear it first")
        await self._watchdogs_on()
        new = [name for name in names if not await self._amplifiers.is_enabled(name)]
        try:
            for name in new:
                if self.axes[name].mode is not Mode.IDLE:
                    await self.axes[name].set_mode(Mode.IDLE)
                await self._amplifiers.enable(name)
            if mode is not Mode.IDLE:
                free = [n for n in names if Cause.LIMIT not in reading.joints[n].latched]
                await asyncio.gather(*(self.axes[name].set_mode(mode) for name in free))
                for name in set(names) - set(free):
                    log.warning("%s: its limit is latched; it stays idle until homing backs it off", name)
        except BaseException:
            await run_to_completion(self._give_up(new))
            raise
        log.info("enabled: %s", ", ".join(names))

    async def _give_up(self, names: list[str]) -> None:
        """Disable as far as that goes; what kept the joints from being enabled is raised, not what follows."""
        try:
            await self.disable(names)
        except MedusaError as error:
            log.error("%s", error)

    async def _watchdogs_on(self) -> None:
        await asyncio.gather(*(self.set_watchdog(board) for board in self.boards.values()))
        self._feeding.start()
        self._stall_watch.start()

    async def set_watchdog(self, board: Board) -> None:
        """Switch a board's watchdog on as configured."""
        safety = self.config.safety
        await board.watchdog(safety.board_watchdog_ms, WATCHDOG_ACTIONS[safety.board_watchdog_action])

    async def disable(self, names: Collection[str]) -> None:
        """End rates by their ramps, go idle, wait for rest, inhibit the amplifiers; the watchdogs end with the last.

        Raises DeviceFault naming the joints that do not come to rest; their amplifiers stay on and brake them.
        """
        wanted = [name for name in names if name in self.enabled]
        await asyncio.gather(*(self.axes[name].brake() for name in wanted if self.axes[name].may_ramp))
        await asyncio.gather(*(self.axes[name].set_mode(Mode.IDLE) for name in wanted))
        await self._amplifiers.inhibit(wanted)
        if not self.enabled:
            await self._feeding.end()
            await self._stall_watch.end()
            await asyncio.gather(*(board.watchdog(0) for board in self.boards.values()))
            log.info("disabled: every amplifier inhibited at rest")

    async def rest(self, names: Collection[str]) -> None:
        """Wait until these joints are at rest; raises DeviceFault naming those that are not in time."""
        await self._stopping.rest(names)

    async def home(self, names: Collection[str], mover: Mover) -> dict[str, HomingResult]:
        """Home the named joints in the configured order; enables them first.

        Raises HomingError with its named failure, the joint left disabled; CommandError for a joint that was
        not checked since its configuration changed.
        """
        return await home_joints(self, names, mover)

    def plan(
        self,
        reading: Reading,
        targets: Mapping[str, float],
        speeds: Mapping[str, Speeds],
        *,
        together: bool = False,
    ) -> MovePlan:
        """Trapezoids on the chip's registers; see `plan_move`."""
        return plan_move(self.axes, reading, targets, speeds, together=together)

    async def arm(self, plan: MovePlan) -> None:
        """MOVE of every axis, to wait for START; all or none."""
        arming = [self.axes[name].arm(move.final, move.profile) for name, move in plan.device.items()]
        ended = await asyncio.gather(*arming, return_exceptions=True)
        failures = [end for end in ended if end is not None]
        for failure in failures:
            if not isinstance(failure, CommandError):
                raise failure
        if failures:
            # Nothing has begun: those that are armed forget it, and what else moves goes on.
            await asyncio.gather(*(self.axes[name].stop(after_pending=True) for name in plan.device))
            raise failures[0]

    async def run(self, plan: MovePlan) -> MoveEnds:
        """START on every board in one turn of the loop, and the boards' "profile done"."""
        arrivals = Arrivals({name: self.axes[name] for name in plan.device})
        try:
            repeated = await self._start(plan)
            try:
                async with asyncio.timeout(plan.duration + EVENT_MARGIN_SECONDS):
                    await arrivals.all
            except TimeoutError:
                await self._ask_for_the_end(plan)
        finally:
            arrivals.close()
        return MoveEnds(starts(self.axes, plan, arrivals.times), arrivals.times, repeated)

    async def _start(self, plan: MovePlan) -> tuple[str, ...]:
        """START of each board; the boards whose START had to be repeated."""
        masks: dict[int, int] = {}
        for name in plan.device:
            axis = self.axes[name]
            masks[axis.board.address] = masks.get(axis.board.address, 0) | 1 << axis.channel
        before = {address: self.boards[address].repeats for address in masks}
        await asyncio.gather(*(self.boards[address].start(mask) for address, mask in masks.items()))
        return tuple(f"{a:02X}H" for a in masks if self.boards[a].repeats != before[a])

    async def _ask_for_the_end(self, plan: MovePlan) -> None:
        """Ask whether the event was lost; raises DeviceFault when the profile has not ended."""
        joints = (await self.read(plan.device)).joints
        late = [
            name
            for name, move in plan.device.items()
            if joints[name].moving or joints[name].device.command != move.final
        ]
        if late:
            raise DeviceFault(
                f"{', '.join(late)}: profile not done {plan.duration:.2f} s after START", axis=late[0]
            )

    async def set_rates(self, rates: Mapping[str, float]) -> dict[str, float]:
        """Rates (rad/s) in a velocity mode; an axis in none enters integral velocity mode."""

        async def one(name: str, rate: float) -> float:
            axis = self.axes[name]
            if axis.mode not in VELOCITY_MODES:
                if axis.mode is Mode.IDLE:
                    raise CommandError(f"{name}: is idle; enable it first")
                await axis.set_mode(Mode.INTEGRAL_VELOCITY)
            return await axis.set_rate(rate)

        taken = await asyncio.gather(*(one(name, rate) for name, rate in rates.items()))
        return dict(zip(rates, taken, strict=True))

    async def step(self, angles: Mapping[str, float]) -> None:
        """COMMAND of each axis in position mode."""

        async def one(name: str, angle: float) -> None:
            axis = self.axes[name]
            if axis.mode is not Mode.IDLE:
                await axis.set_mode(Mode.POSITION)
            await axis.step(angle)

        await asyncio.gather(*(one(name, angle) for name, angle in angles.items()))

    async def stop(self, names: Collection[str]) -> None:
        """STOP of the boards whose joints are all named, of single axes on the others."""

        async def stop_board(board: Board, unit: tuple[str, ...]) -> None:
            for name in unit:
                self.axes[name].stopping()
            await self._restarted_is_open(board)
            await board.stop()

        async def stop_unit(board: Board, unit: tuple[str, ...]) -> None:
            wanted = [name for name in unit if name in names]
            if len(wanted) == len(unit):
                await stop_board(board, unit)
            else:
                await asyncio.gather(*(self.axes[name].stop(after_pending=True) for name in wanted))

        units = zip(self.boards.values(), self.units, strict=True)
        await asyncio.gather(*(stop_unit(board, unit) for board, unit in units))

    async def _restarted_is_open(self, board: Board) -> None:
        """A restarted board is sent a HELLO by the line at once, which idles it: wait for that, then stop it."""
        for _ in range(round(self._stopping.deadline / READ_BACK_SECONDS)):
            if not board.awaits_handshake:
                return
            await asyncio.sleep(READ_BACK_SECONDS)

    async def emergency_stop(self) -> None:
        """EMERGENCY_STOP by broadcast and to each address."""
        for axis in self.axes.values():
            axis.stopping()
        await self.line.emergency_stop()

    async def clear(self) -> None:
        """CLEAR of the boards; the amplifiers' events reset, and what a host that died left of them ended."""
        await self._amplifiers.clear()
        await asyncio.gather(*(board.clear() for board in self.boards.values()))

    async def after_stop(self, fault: Fault) -> str:
        """Zero the marks of joints whose count is wrong; return what the amplifier reports of its fault."""
        if fault.cause in INVALIDATES_HOMING:
            for name in fault.joints:
                axis = self.axes[name]
                await axis.board.write_mark(axis.channel, NO_MARK)
        if fault.cause is not Cause.DRIVE:
            return ""
        reported: list[str] = []
        for name in fault.joints:
            try:
                reported += (await self.amplifiers[name].status()).faults
            except MedusaError as error:
                reported.append(str(error))
        return f"the amplifier reports {', '.join(reported)}" if reported else ""

    def details(self, reading: Reading) -> dict[str, dict[str, Any]]:
        """Mode, counts, motor command and inputs of the chips."""
        return {name: details_of(joint) for name, joint in reading.joints.items()}

    def mark(self, name: str) -> bytes:
        """The homing mark that a joint homed on this machine, with this configuration, carries."""
        axis = self.axes[name]
        return make_mark(self.port_name, name, axis.config, axis.board.boot_count)

    async def _recall_homing(self) -> None:
        """Take the marks that the boards carry as valid, unless an amplifier lost its feedback or does not answer."""
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
                log.warning("%s: its amplifier lost the feedback; homing is invalid", name)
                await axis.board.write_mark(axis.channel, NO_MARK)
            else:
                axis.homed = mark == self.mark(name)
