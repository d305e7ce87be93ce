"""Stops that count only when they have been read back: whoever stops the head knows that it is at rest."""

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Collection, Mapping

from medusa.errors import DeviceFault, DeviceSilent, MedusaError, NoReply
from medusa.head.drive import Drive, JointState
from medusa.head.faults import Cause

log = logging.getLogger(__name__)

REST_STEPS = 1.5
"""A joint at rest in control may flicker by one step of its resolution (thesis, servo loop: its limit cycle)."""
READ_BACK_SECONDS = 0.025
"""Between two readings that are compared: a dozen samples of the slowest sample timer."""
MARGIN_SECONDS = 1.5
"""On top of the ramp: the link's repeats, and the coasting of a joint that a fault has left limp."""

STOP_ATTEMPTS = 3

Condition = Callable[[JointState], bool]
Names = Collection[str]


def is_stopped(joint: JointState) -> bool:
    """True when nothing commands motion."""
    return not joint.moving


def is_emergency_stopped(joint: JointState) -> bool:
    """True when nothing commands motion or drives the joint, and the emergency stop is latched."""
    return not joint.moving and Cause.EMERGENCY_STOP in joint.latched


class Stopping:
    """Stop, emergency stop and rest of every joint, each read back with a deadline."""

    def __init__(self, drive: Drive) -> None:
        self._drive = drive
        self.deadline = max(t.ramp_seconds for t in drive.traits.values()) + MARGIN_SECONDS

    async def stop(self) -> None:
        """Stop every joint by its ramp and confirm that all are at rest.

        Raises DeviceFault naming the joints whose stop could not be confirmed, after an emergency stop.
        """
        failures = await self._on_every_unit(self._stop_unit)
        if failures:
            log.error("stop not confirmed (%s): emergency stop", _reported(failures))
            with contextlib.suppress(MedusaError):
                # What matters is raised below: that the stop itself was not confirmed.
                await self._drive.emergency_stop()
            raise self._unconfirmed("stop", failures)
        log.info("stopped, confirmed")

    async def _stop_unit(self, names: Names) -> None:
        for left in reversed(range(STOP_ATTEMPTS)):
            try:
                await self._drive.stop(names)
                break
            except DeviceSilent:
                raise
            except NoReply as error:
                # Unlike a motion, a stop may be sent as often as needed.
                if not left:
                    raise
                log.warning("stop: %s", error)
        await self.confirm(names, is_stopped)

    async def emergency_stop(self) -> None:
        """Stop everything at once and confirm that all joints are at rest and the stop is latched.

        Raises DeviceFault naming the joints for which that could not be confirmed.
        """
        try:
            await self._drive.emergency_stop()
        except MedusaError as error:
            log.error("emergency stop: %s", error)

        def condition(joint: JointState) -> bool:
            limp = self._drive.can.emergency == "holds" or not joint.enabled
            return limp and is_emergency_stopped(joint)

        failures = await self._on_every_unit(lambda names: self.confirm(names, condition))
        if failures:
            raise self._unconfirmed("emergency stop", failures)
        log.info("emergency stop, confirmed")

    async def rest(self, names: Names) -> None:
        """Wait until these joints are at rest; raises DeviceFault naming those that are not in time."""

        async def confirm(unit: Names) -> None:
            await self.confirm([name for name in unit if name in names], is_stopped)

        failures = await self._on_every_unit(confirm)
        if failures:
            raise self._unconfirmed("rest", failures)

    async def confirm(self, names: Names, condition: Condition) -> None:
        """Read joints back until they satisfy `condition` and are at rest; DeviceFault in vain.

        They are of one unit. Rest is two readings that agree, both from after this call: a repeated reply may show
        the machine as it was before the stop.
        """
        if not names:
            return
        loop = asyncio.get_running_loop()
        asked = loop.time()
        deadline = asked + self.deadline
        before: Mapping[str, JointState] = {}
        while True:
            reading = await self._drive.read(names)
            moving = [
                name
                for name in names
                if not (
                    condition(reading.joints[name])
                    and reading.joints[name].time > asked
                    and self._agree(name, before.get(name), reading.joints[name])
                )
            ]
            if not moving:
                return
            if loop.time() > deadline:
                raise DeviceFault(
                    f"{', '.join(moving)}: not at rest {self.deadline:.2f} s after the stop",
                    axis=", ".join(moving),
                )
            before = reading.joints
            await asyncio.sleep(READ_BACK_SECONDS)

    def _agree(self, name: str, before: JointState | None, now: JointState) -> bool:
        if before is None or now.time <= before.time:
            return False
        return abs(now.raw - before.raw) <= REST_STEPS * self._drive.traits[name].resolution

    async def _on_every_unit(
        self, action: Callable[[Names], Awaitable[None]]
    ) -> list[tuple[Names, BaseException]]:
        units = self._drive.units
        results = await asyncio.gather(*(action(unit) for unit in units), return_exceptions=True)
        failures = [(u, r) for u, r in zip(units, results, strict=True) if isinstance(r, BaseException)]
        for _, failure in failures:
            if not isinstance(failure, MedusaError):
                raise failure
        return [(unit, failure) for unit, failure in failures]

    def _unconfirmed(self, what: str, failures: list[tuple[Names, BaseException]]) -> DeviceFault:
        names = ", ".join(
            str(error.axis) if isinstance(error, DeviceFault) and error.axis else ", ".join(unit)
            for unit, error in failures
        )
        watchdog = self._drive.can.watchdog
        acts = (
            "" if watchdog is None else f"; the watchdog of an unreachable device acts within {watchdog:g} s"
        )
        return DeviceFault(
            f"{names}: the {what} could not be confirmed ({_reported(failures)}){acts}", axis=names
        )


def _reported(failures: list[tuple[Names, BaseException]]) -> str:
    reported: dict[str, list[str]] = {}
    for unit, error in failures:
        reported.setdefault(str(error), []).extend(unit)
    return "; ".join(f"{', '.join(joints)}: {error}" for error, joints in reported.items())
