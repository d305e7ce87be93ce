"""Two cameras as one: frames exposed together, by their stamps, with a stated bound."""

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress
from dataclasses import dataclass

from perception.camera.errors import CameraError
from perception.camera.frame import Camera, Frame

_RETRY_S = 0.05


@dataclass(frozen=True, eq=False)
class FramePair:
    """A left and a right frame exposed at most the bound apart; None for an eye that gave none."""

    left: Frame | None
    right: Frame | None

    @property
    def stamp(self) -> float:
        """The mean stamp of the frames there are."""
        stamps = [frame.stamp for frame in (self.left, self.right) if frame is not None]
        return sum(stamps) / len(stamps)


class Pairing:
    """Matches frames by stamp: within `bound` seconds they are a pair.

    A frame whose partner has not come within `patience` seconds of its own arrival goes on alone. Of frames
    that wait only the newest of each side is kept.
    """

    def __init__(self, bound: float, patience: float) -> None:
        if not (bound >= 0.0 and patience >= 0.0):
            raise ValueError(f"bound {bound} s and patience {patience} s cannot be negative")
        self.bound = bound
        self.patience = patience
        self.unpaired = 0
        self._waiting: dict[int, tuple[Frame, float]] = {}

    def put(self, side: int, frame: Frame, now: float) -> FramePair | None:
        """Take a frame of side 0 (left) or 1 (right) that arrived now; the pair it completes, if any."""
        other = self._waiting.get(1 - side)
        if other is not None and abs(other[0].stamp - frame.stamp) <= self.bound:
            self._waiting.clear()
            return FramePair(frame, other[0]) if side == 0 else FramePair(other[0], frame)
        if side in self._waiting:
            self.unpaired += 1
        self._waiting[side] = frame, now
        return None

    def overdue(self, now: float) -> FramePair | None:
        """The oldest frame that has waited long enough, alone."""
        # The same sum as next_due, or rounding would wake the waiter for nothing.
        late = [(since, side) for side, (_, since) in self._waiting.items() if now >= since + self.patience]
        if not late:
            return None
        side = min(late)[1]
        frame, _ = self._waiting.pop(side)
        self.unpaired += 1
        return FramePair(frame, None) if side == 0 else FramePair(None, frame)

    def next_due(self) -> float | None:
        """When the oldest waiting frame will have waited long enough."""
        return min((since + self.patience for _, since in self._waiting.values()), default=None)


async def paired(left: Camera, right: Camera, *, bound: float, patience: float) -> AsyncIterator[FramePair]:
    """Pairs from two cameras as they come; one eye alone while the other is down.

    A camera that was reopened joins again by itself.

    Args:
        bound: by how much the stamps of a pair may differ, s.
        patience: how long a frame waits for its partner, s.

    Raises:
        CameraError: both cameras are down.
    """
    pairing = Pairing(bound, patience)
    news: asyncio.Queue[tuple[int, Frame | CameraError]] = asyncio.Queue()
    down: dict[int, CameraError] = {}
    loop = asyncio.get_running_loop()

    async def pump(side: int, camera: Camera) -> None:
        newest: Frame | None = None
        while True:
            try:
                missed = camera.latest()
                if newest is not None and missed is not None and missed is not newest:
                    newest = missed
                    news.put_nowait((side, missed))
                async for newest in camera.frames():
                    news.put_nowait((side, newest))
            except CameraError as error:
                news.put_nowait((side, error))
                await asyncio.sleep(max(patience, _RETRY_S))

    pumps = [asyncio.create_task(pump(side, camera)) for side, camera in enumerate((left, right))]
    try:
        while True:
            item: tuple[int, Frame | CameraError] | None = None
            with suppress(TimeoutError):
                async with asyncio.timeout_at(pairing.next_due()):
                    item = await news.get()
            if item is not None:
                side, what = item
                if isinstance(what, CameraError):
                    down[side] = what
                    if len(down) == 2:
                        raise what
                else:
                    down.pop(side, None)
                    pair = pairing.put(side, what, loop.time())
                    if pair is not None:
                        yield pair
            alone = pairing.overdue(loop.time())
            if alone is not None:
                yield alone
    finally:
        for task in pumps:
            task.cancel()
        await asyncio.gather(*pumps, return_exceptions=True)
