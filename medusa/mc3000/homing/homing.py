"""Homing the head: groups in their order, the zero from the latched edge, the mark last of all."""

import asyncio
import logging
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from medusa.completion import run_to_completion
from medusa.errors import CommandError, DeviceRestarted, MedusaError, NoReply
from medusa.head.drive import Homed, Mover
from medusa.head.faults import Fault
from medusa.mc3000.axis import Axis
from medusa.mc3000.board import Mode
from medusa.mc3000.check_record import CheckRecord
from medusa.mc3000.config import Mc3000Config
from medusa.mc3000.fault_reports import FaultReports
from medusa.mc3000.homing.search import HomingError, HomingFailure, HomingSearch
from medusa.mc3000.mark import NO_MARK

log = logging.getLogger(__name__)

PRESET_TRIES = 5
DISABLE_TRIES = 3
INTERRUPTED_SECONDS = 5.0


@dataclass(frozen=True)
class HomingResult(Homed):
    """One homed joint: the edge's count before the zero was set, how far the coarse search was off, the rest.

    Counts are by the encoder.
    """

    latched_counts: int
    coarse_error_counts: int
    zero_shift_counts: int
    error_counts: int

    @property
    def details(self) -> dict[str, Any]:
        """Counts of the edge, of the coarse search's error and of the error at the end."""
        return {
            "latched_counts": self.latched_counts,
            "coarse_error_counts": self.coarse_error_counts,
            "error_counts": self.error_counts,
        }


class HomingDrive(Protocol):
    """What homing needs of the drive whose joints it homes."""

    config: Mc3000Config
    port_name: str
    axes: dict[str, Axis]
    fault_reports: FaultReports

    async def enable(self, names: Collection[str]) -> None: ...

    def subscribe(self, listener: Callable[[Fault], None]) -> Callable[[], None]: ...

    def mark(self, name: str) -> bytes: ...


async def home_joints(drive: HomingDrive, names: Iterable[str], mover: Mover) -> dict[str, HomingResult]:
    """Home joints in the configured groups; raises HomingError, the failed joint left disabled."""
    wanted = list(names)
    checked = CheckRecord.of(drive.config, drive.port_name)
    unchecked = [name for name in wanted if not checked.holds(name, drive.config)]
    if unchecked:
        raise CommandError(
            f"{', '.join(unchecked)}: not checked since the configuration changed (port {drive.port_name});"
            " run check first"
        )
    results: dict[str, HomingResult] = {}
    await drive.enable(wanted)
    for group in drive.config.homing.order:
        together = [name for name in group if name in wanted]
        if together:
            results |= {result.axis: result for result in await _home_group(drive, together, mover)}
    return results


async def _home_group(drive: HomingDrive, names: Sequence[str], mover: Mover) -> list[HomingResult]:
    """Home joints together; the first failure ends the others, and the one that explains most is raised."""
    loop = asyncio.get_running_loop()
    tasks = [loop.create_task(home_axis(drive, name, mover)) for name in names]
    try:
        done, pending = await asyncio.wait(tasks, return_when=asyncio.FIRST_EXCEPTION)
        if pending and all(_was_interrupted(task.exception()) for task in done):
            # Whose failure interrupted the others is still being disabled and has not reported yet.
            await asyncio.wait(pending, timeout=INTERRUPTED_SECONDS)
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
    failures = [error for task in tasks if not task.cancelled() and (error := task.exception()) is not None]
    if failures:
        raise min(failures, key=_was_interrupted)
    return [task.result() for task in tasks]


def _was_interrupted(error: BaseException | None) -> bool:
    return isinstance(error, HomingError) and error.failure is HomingFailure.INTERRUPTED


async def home_axis(drive: HomingDrive, name: str, mover: Mover) -> HomingResult:
    """Home one enabled joint; raises HomingError, the joint left disabled."""
    axis = drive.axes[name]
    log.info("%s: homing", name)
    began = asyncio.get_running_loop().time()
    axis.homed = False
    search = HomingSearch(axis, drive.fault_reports, drive.subscribe)
    with search.listening():
        try:
            await axis.board.write_mark(axis.channel, NO_MARK)
            coarse, latched = await search.find_edge()
            shift = await _set_zero(axis, search, latched)
            axis.homed = True
            await axis.set_mode(Mode.POSITION)
            reading = await mover.move_to({name: axis.config.home_angle})
            await axis.board.write_mark(axis.channel, drive.mark(name))
            if await axis.board.read_mark(axis.channel) != drive.mark(name):
                raise HomingError(name, HomingFailure.INTERRUPTED, "the mark does not read back")
        except BaseException as error:
            axis.homed = False
            await run_to_completion(_leave_disabled(mover, name))
            failure = _named(name, error, search)
            if failure is error:
                raise
            raise failure from error
    log.info("%s: homed, edge at %d counts before the zero was set", name, latched)
    return HomingResult(
        axis=name,
        latched_counts=latched,
        coarse_error_counts=coarse - latched,
        zero_shift_counts=shift,
        angle=reading.joints[name].angle,
        error_counts=axis.to_counts(axis.config.home_angle) - reading.joints[name].device.actual,
        seconds=asyncio.get_running_loop().time() - began,
    )


async def _set_zero(axis: Axis, search: HomingSearch, latched: int) -> int:
    """PRESET so that the latched edge has its configured angle; what was added to the count."""
    shift = axis.to_counts(axis.config.home_edge) - latched
    for _ in range(PRESET_TRIES):
        before = await search.rest_idle()
        if await axis.board.position(axis.channel) != before:
            continue
        await axis.board.preset(axis.channel, before + shift)
        after = await axis.board.position(axis.channel)
        if after == before + shift:
            return shift
        # It moved between the reading and the PRESET: what went by is known from no register.
        raise HomingError(
            axis.name,
            HomingFailure.NOT_AT_REST,
            f"moved {after - before - shift} counts while the zero was set",
        )
    raise HomingError(axis.name, HomingFailure.NOT_AT_REST, f"{PRESET_TRIES} times before the zero was set")


def _named(name: str, error: BaseException, search: HomingSearch) -> BaseException:
    """The named failure behind an error; what is no failure of the machine stays what it is."""
    if not isinstance(error, MedusaError):
        return error
    if isinstance(error, HomingError) and error.failure is not HomingFailure.INTERRUPTED:
        return error
    failure = search.failure()
    if failure is not None:
        return failure
    if isinstance(error, HomingError):
        return error
    if isinstance(error, DeviceRestarted):
        return HomingError(name, HomingFailure.RESTARTED, str(error))
    if error.origin in ("port", "line", "device"):
        return HomingError(name, HomingFailure.LINE_LOST, str(error))
    return HomingError(name, HomingFailure.INTERRUPTED, str(error))


async def _leave_disabled(mover: Mover, name: str) -> None:
    for _ in range(DISABLE_TRIES):
        try:
            await mover.stopped_by_fault()
            await mover.disable([name])
            return
        except NoReply as error:
            log.warning("%s: not disabled yet: %s", name, error)
        except MedusaError as error:
            log.error("%s: could not be disabled: %s", name, error)
            return
