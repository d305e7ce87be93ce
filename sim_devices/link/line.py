"""An emulated serial line: devices daisy-chained behind one pseudo-terminal, paced both ways."""

import asyncio
import logging
from collections.abc import Callable, Sequence
from math import inf
from pathlib import Path
from typing import Protocol

from sim_devices.clock import VirtualTimeLoop
from sim_devices.link.device import LinkDevice
from sim_devices.link.faults import Direction, FaultPlan, FaultyWire
from sim_devices.link.pty_port import PtyPort, place_link, remove_link
from sim_devices.link.wire import Wire

log = logging.getLogger(__name__)

BITS_PER_BYTE = 10
# Bytes that wait for the wire before the line stops reading, as the buffer of a UART's driver.
_RECEIVE_BUFFER = 4096
_FAILED_DEVICE_PAUSE_S = 0.1
_LEAST_ADVANCE_S = 1e-3
_WAKE_TOGETHER_S = 4e-3


class Device(Protocol):
    """Something on a serial line. Every time is the running event loop's, in seconds.

    The line calls in rising order of time. A machine shared by several lines may, on the wall clock, be
    asked for a time a little before one that another line asked for: `advance_to` then does nothing.
    """

    send: Callable[[bytes, float], None]
    """Set by the line: put one whole frame on the wire at a time; it is paced, and never interleaved."""

    def receive(self, data: bytes, t: float) -> None:
        """Take bytes of which the last has arrived at t. Advance to t first."""

    def advance_to(self, t: float) -> None:
        """Run physics and firmware up to t, exactly; a t in the past does nothing."""

    def next_due(self) -> float | None:
        """When to call `advance_to` although no byte comes (event, watchdog, ≤ 5 ms in motion), or None."""


class Line:
    """A serial line with its devices: `async with Line([device]) as line: … line.path …`.

    Deadlines are absolute, from 10 bits a byte: on the wall clock a late timer delays nothing but itself.
    Framed devices get whole frames with one timer each. `link` points at the terminal while the line is up.
    """

    def __init__(
        self,
        devices: Sequence[Device],
        baud: int = 115200,
        faults: FaultPlan | None = None,
        *,
        name: str = "line",
        link: Path | None = None,
    ) -> None:
        if baud <= 0:
            raise ValueError(f"baud is {baud}, must be above 0")
        self.devices = tuple(devices)
        self.name = name
        self.lost_bytes = 0
        self.on_receive: Callable[[], None] | None = None
        """Called after devices took bytes: what they share with other lines may have changed."""
        self._link = link
        self._framed = any(isinstance(device, LinkDevice) for device in devices)
        self._inbound, self._outbound = Wire(BITS_PER_BYTE / baud), Wire(BITS_PER_BYTE / baud)
        self.set_faults(faults)
        self._port: PtyPort | None = None
        self._reading = False
        self._dues = [inf] * len(self.devices)
        self._timer: asyncio.TimerHandle | None = None
        self._replug: asyncio.TimerHandle | None = None
        self._serving = False
        self._up_since = 0.0
        self._wake_due = inf
        self._steps_with: VirtualTimeLoop | None = None
        for device in self.devices:
            device.send = self._send

    async def __aenter__(self) -> "Line":
        await self.start()
        return self

    async def __aexit__(self, *exc_info: object) -> None:
        await self.stop()

    @property
    def path(self) -> str:
        """Where clients open the line: the link, or without one the terminal itself."""
        if self._link is not None:
            return str(self._link)
        if self._port is None:
            raise RuntimeError(f"line {self.name} is not plugged in and has no link")
        return self._port.tty_path

    @property
    def plugged(self) -> bool:
        """Whether the cable is in."""
        return self._port is not None

    async def start(self) -> None:
        """Open the terminal and serve it on the running loop."""
        self._loop = asyncio.get_running_loop()
        self._up_since = self._loop.time()
        if isinstance(self._loop, VirtualTimeLoop):
            self._steps_with = self._loop
            self._loop.add_stepper(self)
        self.plug()
        self.rearm()

    async def stop(self) -> None:
        """Hang up for good and remove the link."""
        self.unplug()
        if self._replug is not None:
            self._replug.cancel()
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        if self._steps_with is not None:
            self._steps_with.remove_stepper(self)
            self._steps_with = None

    def next_step(self) -> float:
        """Return when a device wants to be woken: in virtual time without a timer of its own."""
        return self._wake_due

    def step(self, now: float) -> None:
        """Wake the devices that are due."""
        self._serving = True
        self._wake(now)
        self._serving = False
        self._arm()

    def plug(self) -> None:
        """Put the cable in: a new terminal, at the same link."""
        if self._port is not None:
            return
        port = PtyPort()
        try:
            if self._link is not None:
                place_link(self._link, port.tty_path)
        except OSError:
            port.close()
            raise
        self._port = port
        self._listen(True)
        log.info("line %s is served at %s", self.name, self.path)

    def unplug(self) -> None:
        """Pull the cable: clients are hung up on, bytes on the wire are lost, the devices run on."""
        if self._port is None:
            return
        self._listen(False)
        if self._link is not None:
            remove_link(self._link, self._port.tty_path)
        self._port.close()
        self._port = None
        self._inbound.clear()
        self._outbound.clear()
        log.info("line %s is hung up", self.name)

    def hang_up(self, seconds: float) -> None:
        """Pull the cable and put it in again after a time."""
        self.unplug()
        if self._replug is not None:
            self._replug.cancel()
        self._replug = self._loop.call_later(seconds, self.plug)

    def stall(self, seconds: float) -> None:
        """Let nothing more onto the line, either way, for a time."""
        until = self._loop.time() + seconds
        for wire in (self._inbound, self._outbound):
            wire.free = max(wire.free, until)

    def set_faults(self, plan: FaultPlan | None) -> None:
        """Let the wire misbehave by a plan from the next frame on; None: no more."""
        for wire, direction in ((self._inbound, Direction.TO_DEVICE), (self._outbound, Direction.TO_HOST)):
            wire.faults = FaultyWire(plan, self.name, direction) if plan is not None else None

    def rearm(self) -> None:
        """Ask the devices anew when they are due: something out of band has happened to them."""
        self._ask_devices()
        if not self._serving:
            self._arm()

    def _listen(self, on: bool) -> None:
        assert self._port is not None
        if on and not self._reading:
            self._loop.add_reader(self._port.fd, self._readable)
        elif self._reading and not on:
            self._loop.remove_reader(self._port.fd)
        self._reading = on

    def _readable(self) -> None:
        assert self._port is not None
        data = self._port.read()
        if not data:
            return
        t = self._loop.time()
        *frames, rest = data.split(b"\0") if self._framed else (data,)
        for frame in frames:
            self._put(self._inbound, frame + b"\0", t)
        if rest:
            self._put(self._inbound, rest, t)
        if self._inbound.waiting_bytes > _RECEIVE_BUFFER and self._port is not None:
            self._listen(False)
        self._arm()

    def _send(self, data: bytes, t: float) -> None:
        self._put(self._outbound, data, t)
        if not self._serving:
            self._arm()

    def _put(self, wire: Wire, data: bytes, t: float) -> None:
        if self._port is None:
            return
        carried = wire.put(data, t, self._up_since)
        if carried is None:
            return
        if carried.stall_s > 0:
            self.stall(carried.stall_s)
        if carried.hang_up_s is not None:
            self.hang_up(carried.hang_up_s)

    def _arm(self) -> None:
        """Have one timer run at the earliest thing to do."""
        due = self._wake_due if self._steps_with is None else inf
        for wire in (self._inbound, self._outbound):
            if wire.queue and wire.queue[0][0] < due:
                due = wire.queue[0][0]
        timer = self._timer
        if timer is not None:
            if timer.when() <= due:
                return
            timer.cancel()
            self._timer = None
        if due < inf:
            self._timer = self._loop.call_at(due, self._serve)

    def _serve(self) -> None:
        """Do everything that is due, each thing at its own time and in the order of these times."""
        self._timer = None
        self._serving = True
        now = self._loop.time()
        inbound, outbound = self._inbound, self._outbound
        while True:
            arrival = inbound.queue[0][0] if inbound.queue else inf
            departure = outbound.queue[0][0] if outbound.queue else inf
            due = min(arrival, departure, self._wake_due)
            if due > now:
                break
            if due == departure:
                data = outbound.take()
                if data and self._port is not None:
                    self.lost_bytes += self._port.write(data)
            elif due == arrival:
                self._deliver(inbound.take(), due)
            else:
                self._wake(due)
        self._serving = False
        self._arm()

    def _deliver(self, data: bytes, t: float) -> None:
        if data:
            for device in self.devices:
                try:
                    device.receive(data, t)
                except Exception:
                    log.exception("a device on line %s failed on %s", self.name, data.hex(" "))
            self._ask_devices()
            if self.on_receive is not None:
                self.on_receive()
        if (
            self._port is not None
            and not self._reading
            and self._inbound.waiting_bytes < _RECEIVE_BUFFER // 2
        ):
            self._listen(True)

    def _wake(self, t: float) -> None:
        for n, device in enumerate(self.devices):
            # Whoever is due soon comes along: devices in motion then wake together.
            if self._dues[n] > t + _WAKE_TOGETHER_S:
                continue
            try:
                device.advance_to(t)
            except Exception:
                log.exception("a device on line %s failed", self.name)
                self._dues[n] = t + _FAILED_DEVICE_PAUSE_S
                continue
            due = device.next_due()
            # A device that rounds its own time a hair short must not hold the clock still.
            self._dues[n] = inf if due is None else due if due > t else t + _LEAST_ADVANCE_S
        self._wake_due = min(self._dues)

    def _ask_devices(self) -> None:
        for n, device in enumerate(self.devices):
            try:
                due = device.next_due()
            except Exception:
                log.exception("a device on line %s failed", self.name)
                due = self._loop.time() + _FAILED_DEVICE_PAUSE_S
            self._dues[n] = inf if due is None else due
        self._wake_due = min(self._dues, default=inf)
