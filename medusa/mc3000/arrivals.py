"""Waiting for the profiles of several axes to end."""

import asyncio
import math
from collections.abc import Callable, Mapping

from medusa.mc3000.axis import Axis
from medusa.mc3000.board import BoardEvent, EventKind


class Arrivals:
    """Waits for "profile done" of several axes; `times` holds the boards' stamps on the loop's clock, s."""

    def __init__(self, axes: Mapping[str, Axis]) -> None:
        loop = asyncio.get_running_loop()
        self.all: asyncio.Future[None] = loop.create_future()
        self.times: dict[str, float] = {}
        self._axes = axes
        self._since = loop.time()
        self._ends = [axis.subscribe(self._listener(name)) for name, axis in axes.items()]
        if not axes:
            self.all.set_result(None)

    def _listener(self, name: str) -> Callable[[BoardEvent], None]:
        def received(event: BoardEvent) -> None:
            if event.kind is not EventKind.PROFILE_DONE:
                return
            time = self._axes[name].board.clock.to_loop(event.time_us)
            if time is not None and time < self._since:
                return
            self.times[name] = math.nan if time is None else time
            if len(self.times) == len(self._axes) and not self.all.done():
                self.all.set_result(None)

        return received

    def close(self) -> None:
        """Listen no longer."""
        for end in self._ends:
            end()
