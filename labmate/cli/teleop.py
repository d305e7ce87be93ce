"""Driving from the keyboard, with a live view. The base stops when the key, the terminal or the process goes."""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import typer

from labmate.cli.options import Options
from labmate.cli.tables import pose_line, snapshot_document
from labmate.cli.watch import live_table

if TYPE_CHECKING:
    from labmate.base.mobile_base import MobileBase
    from labmate.base.motion import Motion
    from labmate.base.reading import BaseReading
    from labmate.keyboard import Keys


def register(app: typer.Typer) -> None:
    app.command()(teleop)


def teleop(context: typer.Context) -> None:
    """Drive from the keyboard: w a s d or the arrows, space stops, ! is the emergency stop, q quits."""
    options: Options = context.obj
    if not sys.stdin.isatty():
        options.fail("teleop needs a terminal to read keys from")

    async def body() -> BaseReading:
        from rich.live import Live

        async with options.base() as (base, _):
            _ = base.limits
            with Live(auto_refresh=False) as view, _keys_of(sys.stdin.fileno()) as keyboard:
                await _Teleop(base, keyboard, view).run()
            return await base.stop()

    snapshot = options.run(body, realtime=True)
    options.show(snapshot_document(snapshot), lambda: print(f"at rest at {pose_line(snapshot)}"))


class _Keyboard:
    """Keys as they come from a descriptor; `gone` when the terminal hung up."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.gone = False
        self.pressed: list[str] = []

    def read(self) -> None:
        from labmate.keyboard import split_keys

        try:
            data = os.read(self.descriptor, 256)
        except OSError:
            data = b""
        if not data:
            self.gone = True
            asyncio.get_running_loop().remove_reader(self.descriptor)
        self.pressed += split_keys(data)


@contextmanager
def _keys_of(descriptor: int) -> Iterator[_Keyboard]:
    import termios
    import tty

    keyboard = _Keyboard(descriptor)
    loop = asyncio.get_running_loop()
    before = termios.tcgetattr(descriptor)
    tty.setcbreak(descriptor)
    loop.add_reader(descriptor, keyboard.read)
    try:
        yield keyboard
    finally:
        loop.remove_reader(descriptor)
        try:
            termios.tcsetattr(descriptor, termios.TCSAFLUSH, before)
        except termios.error:
            # The terminal has gone.
            keyboard.gone = True


class _Teleop:
    """Keys in, steering out, twenty times a second."""

    def __init__(self, base: MobileBase, keyboard: _Keyboard, view: Any) -> None:
        from labmate.keyboard import Keys

        self._base = base
        self._keyboard = keyboard
        self._view = view
        self._keys: Keys = Keys()
        self._message = ""
        self._quit = False
        self._ticks = 0

    async def run(self) -> None:
        from medusa.errors import MedusaError

        while not self._over:
            await self._tick()
            if self._keys.command(self._now) is None:
                continue
            try:
                async with self._base.motion(hold=0.3) as motion:
                    await self._steer(motion)
            except MedusaError as error:
                # A bumper, an emergency stop: shown, and the next key is a new command.
                self._message = str(error)
                self._keys.release()
                self._base.require_ready()

    async def _steer(self, motion: Motion) -> None:
        limits = self._base.limits
        self._message = ""
        while not self._over and motion.failure is None:
            command = self._keys.command(self._now)
            ahead, left = command if command is not None else (0.0, 0.0)
            motion.twist(ahead * limits.speed, left * limits.turn_rate)
            snapshot = await self._tick()
            if command is None and snapshot.speed == 0.0 and snapshot.turn_rate == 0.0:
                return

    async def _tick(self) -> BaseReading:
        from labmate.keyboard import HELP

        snapshot = await self._base.read()
        self._ticks += 1
        if self._ticks % 3 == 1:
            more = {
                "keys drive at": f"{100 * self._keys.scale:.0f} % of the limits",
                "keys": HELP,
                "message": self._message,
            }
            self._view.update(live_table(snapshot, more), refresh=True)
        await asyncio.sleep(0.05)
        pressed, self._keyboard.pressed = self._keyboard.pressed, []
        for key in pressed:
            await self._take(key)
        return snapshot

    async def _take(self, key: str) -> None:
        if key == "q":
            self._quit = True
        elif key == "!":
            self._keys.release()
            await self._base.emergency_stop()
            self._message = "emergency stop latched; c clears it"
        elif key == "c":
            await self._base.clear()
            self._message = ""
        else:
            self._keys.press(key, self._now)

    @property
    def _now(self) -> float:
        return asyncio.get_running_loop().time()

    @property
    def _over(self) -> bool:
        return self._quit or self._keyboard.gone
