"""What the boards and the link report, as faults of joints."""

import asyncio
import logging
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager

from medusa.errors import DeviceRestarted, HostGap, MedusaError
from medusa.head.faults import Cause, Fault
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Board, BoardEvent, EventKind, Inputs

log = logging.getLogger(__name__)

INVALIDATES_HOMING = frozenset({Cause.LIMIT, Cause.FOLLOWING, Cause.STALLED})
"""Within the soft limits no joint meets a switch or loses its command, unless its count is wrong."""

_CAUSES = {
    EventKind.LIMIT_REACHED: Cause.LIMIT,
    EventKind.STOP_INPUT: Cause.STOP_INPUT,
    EventKind.EMERGENCY_STOPPED: Cause.EMERGENCY_STOP,
    EventKind.WATCHDOG_EXPIRED: Cause.WATCHDOG,
    EventKind.FOLLOWING_ERROR: Cause.FOLLOWING,
    EventKind.AMPLIFIER_FAULT: Cause.DRIVE,
}


def fault_from_event(event: BoardEvent, joints: tuple[str, ...], time: float) -> Fault | None:
    """The fault that a board's event reports, None when the event reports none."""
    cause = _CAUSES.get(event.kind)
    if cause is None or not joints:
        return None
    reason = cause.value
    if cause is Cause.LIMIT:
        closed = [
            name
            for bit, name in ((Inputs.NEGATIVE_LIMIT, "negative"), (Inputs.POSITIVE_LIMIT, "positive"))
            if event.inputs & bit
        ]
        reason = f"{' and '.join(closed) or 'a'} limit switch reached at {event.position} counts"
    elif cause is Cause.FOLLOWING:
        reason = f"following error at {event.position} counts: the joint does not follow its command"
    elif cause is Cause.DRIVE:
        reason = f"amplifier fault (inputs {event.detail:02X}H)"
    elif cause is Cause.WATCHDOG:
        reason = "watchdog expired: the board received nothing from the host in time"
    return Fault(cause, joints, reason, time)


class FaultReports:
    """Listens to every board and publishes its faults; homing that a fault makes invalid ends here."""

    def __init__(
        self, axes: Mapping[str, Axis], boards: Mapping[int, Board], publish: Callable[[Fault], None]
    ) -> None:
        self._axes = axes
        self._publish = publish
        self._expected: list[str] = []
        self._leave: list[Callable[[], None]] = []
        for board in boards.values():
            self._watch(board)

    def close(self) -> None:
        """Listen no longer."""
        for leave in self._leave:
            leave()
        self._leave.clear()

    @contextmanager
    def limit_expected(self, joint: str) -> Iterator[None]:
        """Within the context this joint's limit switches are no fault."""
        self._expected.append(joint)
        try:
            yield
        finally:
            self._expected.remove(joint)

    def report(self, fault: Fault) -> None:
        """Publish a fault, unless it is a limit switch that a search expects."""
        if fault.cause is Cause.LIMIT and len(fault.joints) == 1 and fault.joints[0] in self._expected:
            return
        if fault.cause in INVALIDATES_HOMING:
            for name in fault.joints:
                self._axes[name].homed = False
        self._publish(fault)

    def _watch(self, board: Board) -> None:
        joints = tuple(name for name, axis in self._axes.items() if axis.board is board)

        def on_event(event: BoardEvent) -> None:
            concerned = tuple(n for n in joints if event.axis in (None, self._axes[n].channel))
            now = asyncio.get_running_loop().time()
            fault = fault_from_event(event, concerned, board.clock.to_loop(event.time_us) or now)
            if fault is not None:
                self.report(fault)

        def on_lost(error: MedusaError) -> None:
            restarted = isinstance(error, DeviceRestarted)
            cause, what = (
                (Cause.RESTARTED, "board restarted") if restarted else (Cause.LOST, Cause.LOST.value)
            )
            for name in joints:
                self._axes[name].lost()
                # Whether the count still holds is read from the mark when the board is opened again.
                self._axes[name].homed = False
            self.report(Fault(cause, joints, f"{what}: {error}", asyncio.get_running_loop().time()))

        def on_gap(gap: HostGap) -> None:
            for name in joints:
                self._axes[name].stopping()
            self.report(Fault(Cause.WATCHDOG, joints, str(gap), asyncio.get_running_loop().time()))

        def on_restart(error: MedusaError) -> None:
            for name in joints:
                self._axes[name].homed = False
            log.warning("%s", error)

        self._leave += [
            board.subscribe(on_event),
            board.session.on_lost(on_lost),
            board.session.on_restart(on_restart),
            board.session.on_gap(on_gap),
        ]
