"""A session on a line that loses, damages, doubles, splits and delays: what must hold whatever happens.

The emulator journals every command that acted. Each request bears a tag of its own, so that a reply given to
another request, a command that acted twice and a motion that acted after a later stop all show.
"""

import asyncio
import struct
from collections import Counter
from collections.abc import Callable, Coroutine
from typing import Any

from hypothesis import HealthCheck, Phase, seed, settings
from hypothesis import strategies as st
from hypothesis.stateful import RuleBasedStateMachine, initialize, rule, run_state_machine_as_test

from medusa.errors import CommandError, MedusaError, PortError, ProtocolError
from medusa.link import Line, Operation
from medusa.link.messages import EMERGENCY_STOP
from sim_devices.clock import VirtualTimeLoop
from sim_devices.link.device import LinkDevice
from sim_devices.link.faults import FaultPlan
from sim_devices.link.line import Line as EmulatedLine
from tests.medusa.link.toy_operations import ADD, MOVE, RAISE_EVENT, READ, STOP

REQUEST_SIZES = {READ: 4, ADD: 5, STOP: 4, RAISE_EVENT: 5, MOVE: 4}
REPLY_SIZES = {READ: 8, ADD: 5, STOP: 4, RAISE_EVENT: 5, MOVE: 4}
DEADLINE = 0.1

EXAMPLES = settings(
    max_examples=15,
    stateful_step_count=100,
    deadline=None,
    derandomize=True,
    database=None,
    phases=(Phase.generate,),
    suppress_health_check=list(HealthCheck),
)

# Requests over all examples; the last test of this file holds their number.
counted = Counter[str]()


class Hostile(RuleBasedStateMachine):
    make_toy: Callable[[], Any]

    @initialize(
        seed=st.integers(0, 2**32 - 1),
        drop=st.sampled_from([0.0, 0.05, 0.2, 0.4]),
        flip=st.sampled_from([0.0, 0.05, 0.2]),
        double=st.sampled_from([0.0, 0.1, 0.4]),
        delay=st.sampled_from([0.0, 0.05, 0.2]),
        split=st.sampled_from([0.0, 0.2]),
        start=st.integers(0, 63),
    )
    def connect(
        self, seed: int, drop: float, flip: float, double: float, delay: float, split: float, start: int
    ) -> None:
        self.loop = VirtualTimeLoop()
        self.toy = self.make_toy()
        self.toy.sizes = {operation.code: size for operation, size in REQUEST_SIZES.items()}
        self.device = LinkDevice(1, self.toy, boot_count=7)
        self.device.journal = []
        plan = FaultPlan(
            seed=seed,
            drop=drop,
            flip=flip,
            insert=flip / 2,
            double=double,
            delay=delay,
            delay_s=3 * DEADLINE,
            split=split,
        )
        self.emulated = EmulatedLine([self.device], faults=plan)
        self.tag = 0
        self.submitted: dict[int, int] = {}
        self.estops = 0
        self.tasks: set[asyncio.Task[None]] = set()
        self.failures: list[str] = []
        self.events: list[int] = []
        self.drive(self._connect(seed, start))

    async def _connect(self, seed: int, start: int) -> None:
        await self.emulated.start()
        self.line = Line(self.emulated.path, reply_timeout=DEADLINE, seed=seed)
        await self.line.open()
        self.session = self.line.session(1)
        # Without its size a frame whose 00 was hit would pass, with the next one as part of its payload.
        self.session.describe(REPLY_SIZES, {}, event_size=4)
        self.session.subscribe(lambda event: self.events.append(struct.unpack("<I", event.payload)[0]))
        await self._greet()
        # So that the numbers' wrap falls anywhere in an example.
        for _ in range(start):
            await self._ask(READ)

    async def _greet(self) -> None:
        for _ in range(50):
            try:
                await self.session.open()
                await self.session.event_mask(0xFFFFFFFF)
            except MedusaError:
                continue
            return
        raise AssertionError("no HELLO came through in 50 tries")

    def drive(self, work: Coroutine[Any, Any, None]) -> None:
        self.loop.run_until_complete(work)

    async def _ask(
        self,
        operation: Operation,
        axis: int = 0x0F,
    ) -> None:
        self.tag += 1
        tag = self.tag
        mark = struct.pack("<I", tag)
        payload = {ADD: b"\x01" + mark, RAISE_EVENT: b"\x41" + mark}.get(operation, mark)
        counted["requests"] += 1
        self.submitted[tag] = operation.code
        try:
            reply = await self.session.request(operation, axis, payload, reply_size=REPLY_SIZES[operation])
        except CommandError as error:
            counted["refused"] += 1
            # 3: each sending ran into the next frame, which the device sees as a wrong length.
            if error.status not in (None, 3, 9):
                self.failures.append(str(error))
        except (ProtocolError, PortError):
            counted["unanswered"] += 1
        except asyncio.CancelledError:
            counted["cancelled"] += 1
            raise
        else:
            counted["answered"] += 1
            if mark not in reply:
                self.failures.append(f"request {tag} was given {reply.hex()}")

    def _start(self, operation: Operation, axis: int = 0x0F) -> None:
        async def begin() -> None:
            task = asyncio.create_task(self._ask(operation, axis))
            self.tasks.add(task)
            task.add_done_callback(self.tasks.discard)
            await asyncio.sleep(0)

        if len(self.tasks) < 24:
            self.drive(begin())

    @rule(count=st.integers(1, 8))
    def read(self, count: int) -> None:
        for _ in range(count):
            self._start(READ)

    @rule(count=st.integers(1, 4), axis=st.sampled_from([0, 1, 2, 0x0F]))
    def add(self, count: int, axis: int) -> None:
        for _ in range(count):
            self._start(ADD, axis)

    @rule(axis=st.sampled_from([0, 1, 2]))
    def move(self, axis: int) -> None:
        self._start(MOVE, axis)

    @rule(axis=st.sampled_from([0, 0x0F]))
    def stop(self, axis: int) -> None:
        self._start(STOP, axis)

    @rule()
    def raise_event(self) -> None:
        self._start(RAISE_EVENT, 1)

    @rule()
    def emergency_stop_and_clear(self) -> None:
        async def both() -> None:
            counted["requests"] += 2
            self.estops += 1
            for action in (self.session.emergency_stop, self.session.clear):
                try:
                    await action()
                except MedusaError:
                    counted["unanswered"] += 1

        self.drive(both())

    @rule(time=st.floats(0.0, 0.35))
    def wait(self, time: float) -> None:
        self.drive(asyncio.sleep(time))

    @rule(which=st.integers(0, 30), time=st.floats(0.0, 0.15))
    def cancel(self, which: int, time: float) -> None:
        async def later() -> None:
            await asyncio.sleep(time)
            tasks = sorted(self.tasks, key=lambda task: task.get_name())
            if tasks:
                tasks[which % len(tasks)].cancel()
                await asyncio.sleep(0)

        self.drive(later())

    @rule()
    def greet_again_if_lost(self) -> None:
        if not self.session.may_move:
            self.drive(self._greet())

    def teardown(self) -> None:
        if not hasattr(self, "loop"):
            return

        async def finish() -> None:
            # Three sendings of what waits behind others, and the second after which a device is silent.
            if self.tasks:
                _, hanging = await asyncio.wait(self.tasks, timeout=30)
                assert not hanging, "a request neither ended nor failed"
            await self.line.close()
            await self.emulated.stop()

        try:
            self.drive(finish())
            self.check()
        finally:
            self.loop.close()

    def check(self) -> None:
        assert self.failures == []
        acted = [e for e in self.device.journal or [] if e.status == 0 and e.operation >= 0x30]
        tags = [
            (e.operation, struct.unpack("<I", e.payload[-4:])[0]) for e in acted if e.operation != READ.code
        ]
        assert [tag for tag, times in Counter(tags).items() if times > 1] == [], "acted twice"
        assert all(self.submitted[tag] == operation for operation, tag in tags)
        # A 01 put before a frame makes it a broadcast of what was its number (link.md's CRC does not see leading
        # zeros), 5 an emergency stop; its "axis" is then the operation, never 0FH.
        estops = sum(
            (e.operation, e.axis, e.payload) == (EMERGENCY_STOP.code, 0x0F, b"")
            for e in self.device.journal or []
        )
        assert estops <= self.estops, "an emergency stop acted twice"
        latest_stop = 0
        for operation, tag in tags:
            if operation == STOP.code:
                latest_stop = max(latest_stop, tag)
            elif operation == MOVE.code:
                assert tag > latest_stop, "a motion acted after a later stop"
        for axis in (0, 1, 2):
            ordered = [
                struct.unpack("<I", entry.payload[-4:])[0]
                for entry in acted
                if entry.operation in (ADD.code, MOVE.code, RAISE_EVENT.code) and entry.axis in (axis, 0x0F)
            ]
            assert ordered == sorted(ordered), "what acts on one axis acted in another order than asked"
        assert max(Counter(self.events).values(), default=1) == 1, "an event was handed on twice"
        counted["acted"] += len(tags)
        counted["moves"] += sum(operation == MOVE.code for operation, _ in tags)
        counted["repeats"] += self.session.counters.repeats
        counted["late"] += self.session.counters.late_replies


def test_whatever_the_line_does_each_reply_is_its_own_and_nothing_acts_twice_or_after_a_stop(
    toy: object,
) -> None:
    counted.clear()
    for number in range(40):

        @seed(number)
        class Machine(Hostile):
            # The device's application comes from conftest.py, which tests cannot import.
            make_toy = staticmethod(type(toy))

        run_state_machine_as_test(Machine, settings=EXAMPLES)
        if counted["requests"] >= 10_000:
            break
    # What was done is enough to mean something: ten thousand requests, and every kind of trouble among them.
    assert counted["requests"] >= 10_000
    assert min(counted[kind] for kind in ("repeats", "late", "unanswered", "cancelled", "moves")) > 100
