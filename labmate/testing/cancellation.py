"""Cancel a program that drives a base, at random moments, and look whether the base is at rest when it returns."""

from __future__ import annotations

import asyncio
import random
from collections.abc import Awaitable, Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from typing import Final

from labmate.base import MobileBase

Open = Callable[[], AbstractAsyncContextManager[MobileBase]]

_SPEED_SHARE = 0.9
_TWISTS = 40
_TWIST_PERIOD = 0.05
_LONGEST_GAP = 0.4


async def _go(base: MobileBase) -> None:
    await base.go(base.limits.speed * 2.0)


async def _turn(base: MobileBase) -> None:
    await base.turn(-base.limits.turn_rate * 2.0)


async def _motion(base: MobileBase) -> None:
    async with base.motion() as motion:
        for _ in range(_TWISTS):
            motion.twist(base.limits.speed * _SPEED_SHARE, base.limits.turn_rate * _SPEED_SHARE)
            await asyncio.sleep(_TWIST_PERIOD)


async def _stop(base: MobileBase) -> None:
    async with base.motion(hold=2.0) as motion:
        motion.twist(base.limits.speed * _SPEED_SHARE, 0.0)
        await asyncio.sleep(1.0)
        await base.stop()


PROGRAMS: Final[dict[str, Callable[[MobileBase], Awaitable[None]]]] = {
    "go": _go,
    "turn": _turn,
    "motion": _motion,
    "stop": _stop,
}
"""What is cancelled on an open base."""


@dataclass(frozen=True, slots=True)
class Outcome:
    """One program, cancelled `cancels` times: whether the base moved when it returned, or at any time after."""

    program: str
    cancels: int
    ended: str
    moving: bool
    moved_later: bool


async def cancel_at_random(
    rng: random.Random, open_base: Open, moving: Callable[[], bool], program: str, cancels: int, span: float
) -> Outcome:
    """Run a program, cancel it first within `span` s and then again at once, a turn or up to 0.4 s later.

    `program`: a key of PROGRAMS, on a base that stays open; or with " in its context": opened and left by what is
    cancelled. `moving`: the truth, from outside.
    """
    name, _, whole = program.partition(" ")
    if whole:

        async def run() -> None:
            async with open_base() as base:
                await PROGRAMS[name](base)

        return await _cancelled(rng, run, moving, program, cancels, span)
    async with open_base() as base:
        return await _cancelled(rng, lambda: PROGRAMS[name](base), moving, program, cancels, span)


async def _cancelled(
    rng: random.Random,
    run: Callable[[], Awaitable[None]],
    moving: Callable[[], bool],
    program: str,
    cancels: int,
    span: float,
) -> Outcome:
    returned: list[bool] = []

    async def watched() -> None:
        try:
            await run()
        finally:
            returned.append(moving())

    task = asyncio.ensure_future(watched())
    await asyncio.sleep(rng.uniform(0.0, span))
    for _ in range(cancels):
        task.cancel()
        gap = rng.choice((None, 0.0, rng.uniform(0.0, 0.01), rng.uniform(0.0, _LONGEST_GAP)))
        if gap is not None:
            await asyncio.sleep(gap)
    await asyncio.wait((task,))
    moved_later = False
    for _ in range(20):
        await asyncio.sleep(0.05)
        moved_later |= moving()
    if task.cancelled():
        ended = "cancelled"
    else:
        error = task.exception()
        ended = "returned" if error is None else type(error).__name__
    return Outcome(program, cancels, ended, any(returned), moved_later)
