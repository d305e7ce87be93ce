"""The host's half of the serial link with one device, as a state machine without input, output or clock.

Theory of operation. A request is queued, is live from its first sending to its end, and leaves an abandoned
slot behind when it ends unanswered: its place in the window until its deadline, its sequence number out of use
for longer.

| state     | goes out                 | left by                                                          |
|-----------|--------------------------|------------------------------------------------------------------|
| CLOSED    | HELLO, EMERGENCY_STOP    | HELLO sent → HANDSHAKE; a second without a reply → SILENT        |
| HANDSHAKE | nothing                  | answered → OPEN; given up, or a stop → CLOSED (SILENT if it was) |
| OPEN      | everything               | HELLO sent → HANDSHAKE; status 10, port lost → CLOSED; → SILENT  |
| SILENT    | HELLO, EMERGENCY_STOP    | HELLO sent → HANDSHAKE; port lost → CLOSED                       |
"""

from enum import Enum, auto
from typing import Final

from medusa.errors import DeviceSilent, MedusaError, PortError
from medusa.link.contact import Contact
from medusa.link.events import Inbox, acknowledge
from medusa.link.exchange_host import Counters, ExchangeHost
from medusa.link.failure import NO_HELLO, Failures
from medusa.link.frame import EVENT, REPLY, Message, encode_frame, encode_request
from medusa.link.messages import EMERGENCY_STOP, HELLO, WATCHDOG
from medusa.link.request import BAD_LENGTH, Request
from medusa.link.request_queue import RequestQueue
from medusa.link.sequence_numbers import SequenceNumbers

WINDOW: Final = 4
SENT_AFTER_REPEATABLE: Final = 7
SILENCE_S: Final = 1.0
NEVER: Final = float("inf")
# A timer that comes this much too late shows that the host was stopped, or its loop blocked.
_LATE_S: Final = 0.1
# Timers may come this much early; float sums of seconds are exact to far less.
_EARLY: Final = 1e-6


class State(Enum):
    """State of the conversation."""

    CLOSED = auto()
    HANDSHAKE = auto()
    OPEN = auto()
    SILENT = auto()


class Exchange:
    """Requests, replies and events of one device; `due` is when `expire` wants to be called."""

    def __init__(self, address: int, host: ExchangeHost, contact: Contact) -> None:
        self.address = address
        self.contact = contact
        self.state = State.CLOSED
        self.counters = Counters()
        self.due = NEVER
        self.event_size: int | None = None
        self._host = host
        self._errors = Failures(address)
        self._before = State.CLOSED
        self._queue = RequestQueue()
        self._live: dict[int, Request] = {}
        self._abandoned: list[Request] = []
        self._sequence_numbers = SequenceNumbers()
        self._inbox = Inbox()
        self._sent = 0
        self._unanswered_since: float | None = None
        self._gave_up = False

    @property
    def is_silent(self) -> bool:
        """Whether the device answered nothing for a second, and no HELLO since."""
        return State.SILENT is (self._before if self.state is State.HANDSHAKE else self.state)

    def submit(self, request: Request, now: float) -> None:
        """Take a request in: it is sent now, later, or finished with an error."""
        self.counters.requests += 1
        self.look(now)
        refusal = self.contact.refusal() if request.moves else None
        if refusal is not None:
            self._host.finish(request, refusal)
            return
        if self.state is not State.OPEN:
            if not self._admits(request):
                return
        elif not (self._queue or self._live or self._abandoned or request.stops):
            if not self._send(request, now):
                self._queue.append(request)
            return
        if request.stops:
            self.withdraw(now, request)
        if request.urgent and self._may_interrupt(request, now):
            self._send(request, now)
        elif request.urgent:
            self._queue.appendleft(request)
        else:
            self._queue.append(request)
            self._pump(now)

    def cancel(self, request: Request, now: float) -> None:
        """Nobody waits for it any more: not repeated, its reply swallowed. A stop is carried through all the same."""
        self.look(now)
        if request in self._queue:
            self._queue.remove(request)
        elif self._live.get(request.sequence) is request and not request.urgent:
            self._abandon(request, now)
        self._pump(now)

    def withdraw(self, now: float, stop: Request | None = None) -> None:
        """Withdraw what a stop overrules; without `stop`, everything that gives way to a broadcast one."""
        urgent = stop is None or stop.urgent
        everywhere = urgent or (stop is not None and stop.operation is HELLO)
        for request in [*self._live.values(), *self._queue]:
            overruled = request.moves or (urgent and request.gives_way)
            if overruled and (stop is None or everywhere or stop.depends_on(request)):
                self._withdraw(request, now, "for a stop")

    def look(self, now: float) -> None:
        """End every motion when the device's watchdog may have expired; called before anything leaves."""
        gap = self.contact.look(now) if self.state is State.OPEN else None
        if gap is None:
            return
        for request in [*self._live.values(), *self._queue]:
            if request.moves:
                self._withdraw(request, now, "after a gap")
        self._host.interrupted(gap)

    def receive(self, message: Message, now: float) -> None:
        """Take in a message that came from the device."""
        self.look(now)
        if message.kind == REPLY:
            request = self._live.get(message.sequence)
            self._unanswered_since = None
            self._gave_up = False
            if request is None or not request.is_answered_by(message):
                self._late(message, now)
            elif request.is_damaged_by(message):
                self._damaged(message, request, now)
            else:
                del self._live[message.sequence]
                self._sequence_numbers.answered(message.sequence, now, request.sendings - 1)
                self.contact.answered(request.first_sent)
                if request.operation is WATCHDOG and message.axis == 0:
                    self._watchdog_set(request)
                if message.axis == 0 and self.state is State.OPEN:
                    self._host.finish(request, message.payload)
                else:
                    self._answered(message, request)
            if self._live or self._abandoned:
                self._await_reply_since(now)
            if self._queue:
                self._pump(now)
        elif message.kind == EVENT:
            self._event(message)
        else:
            self.counters.stray += 1

    def expire(self, now: float) -> None:
        """Do what is due: repeat, give up, notice silence."""
        now += _EARLY
        late = now - self.due
        if self._unanswered_since is not None and late > _LATE_S:
            # This host was away: its own silence is not the device's.
            self._unanswered_since += late
        self.due = NEVER
        self.look(now)
        if self._unanswered_since is not None and now >= self._unanswered_since + SILENCE_S:
            self._fall_silent(now, "answered nothing for a second")
        for request in list(self._live.values()):
            if request.due <= now:
                self._overdue(request, now)
        self._abandoned = [slot for slot in self._abandoned if slot.due > now]
        if not (self._live or self._abandoned or self._gave_up):
            # Only what was cancelled is unanswered: one lost frame is no silence.
            self._unanswered_since = None
        self._pump(now)
        for request in (*self._live.values(), *self._abandoned):
            self.due = min(self.due, request.due)
        if self._unanswered_since is not None:
            self.due = min(self.due, self._unanswered_since + SILENCE_S)

    def lose(self, path: str, reason: str, now: float) -> None:
        """The port is gone: everything under way ends at once."""
        for request in [*self._live.values(), *self._queue]:
            self._end(request, now, PortError(path, reason, may_have_acted=request.sendings > 0))
        self._abandoned.clear()
        self._unanswered_since = None
        self.state = State.CLOSED

    def _admits(self, request: Request) -> bool:
        if request.operation in (HELLO, EMERGENCY_STOP):
            return True
        if self.state is State.HANDSHAKE and not self.is_silent:
            return True
        if self.is_silent:
            self._host.finish(request, self._errors.silent(request, "the device is silent"))
        else:
            self._host.finish(request, self._errors.no_session(request))
        return False

    def _may_interrupt(self, request: Request, now: float) -> bool:
        """An emergency stop ends a HELLO under way, another stop waits for it: HELLO stops the machine itself."""
        if self.state is not State.HANDSHAKE:
            return True
        if request.operation is not EMERGENCY_STOP:
            return False
        for hello in list(self._live.values()):
            self._withdraw(hello, now, "for a stop")
        return True

    def _pump(self, now: float) -> None:
        while self._queue and self.state is not State.HANDSHAKE:
            live = self._live.values()
            request = self._queue.next(live, len(live) + len(self._abandoned), WINDOW)
            if request is None:
                return
            held = any(other.repeatable and self._forgettable(other) for other in live)
            if held or not self._send(request, now):
                return
            self._queue.remove(request)

    def _forgettable(self, request: Request) -> bool:
        """Whether one more request could push it out of the eight that the device remembers."""
        return self._sent - request.order >= SENT_AFTER_REPEATABLE

    def _send(self, request: Request, now: float) -> bool:
        if request.urgent:
            number: int | None = self._sequence_numbers.take_anyway(now)
            for other in self._live.values():
                other.final |= self._forgettable(other)
        else:
            number = self._sequence_numbers.take(now, request.operation is not HELLO)
        if number is None:
            self._starve(now)
            return False
        # A live one sent earlier may act later, by a repeat: it counts like one sent after this.
        self._sent += 1
        request.order = self._sent - len(self._live)
        request.sequence = number
        request.sendings = 1
        request.first_sent = self.contact.time(now)
        request.frame = encode_request(
            self.address, number, request.operation.code, request.axis, request.payload
        )
        self._live[number] = request
        if request.operation is HELLO:
            self._before = State.CLOSED if self.state is State.OPEN else self.state
            self.state = State.HANDSHAKE
        self._put_on_line(request, now)
        return True

    def _put_on_line(self, request: Request, now: float) -> None:
        request.due = due = now + request.deadline
        if due < self.due:
            self.due = due
        if self._unanswered_since is None:
            self._await_reply_since(now)
        self._host.send(request.frame)

    def _await_reply_since(self, now: float) -> None:
        self._unanswered_since = now
        if now + SILENCE_S < self.due:
            self.due = now + SILENCE_S

    def _starve(self, now: float) -> None:
        """Every number is out of use; only answers or time bring one back."""
        release = self._sequence_numbers.next_release(now)
        if release is not None:
            self.due = min(self.due, release)
        elif not self._live and not self._abandoned:
            self._fall_silent(now, "left too many requests unanswered to distinguish its replies")

    def _answered(self, message: Message, request: Request) -> None:
        if request.operation is HELLO:
            self.state = State.OPEN if message.axis == 0 else self._before
            self._sequence_numbers.new_session()
            self._inbox.new_session()
            self.contact.reset()
        if message.axis == 0:
            self._host.finish(request, message.payload)
            return
        error = self._errors.refused(request, message)
        self._host.finish(request, error)
        if message.axis == NO_HELLO and self.state is State.OPEN:
            self.state = State.CLOSED
            self._drop_queue(f"device {self.address:02X}H has restarted")
            self._host.lost(error)

    def _watchdog_set(self, request: Request) -> None:
        timeout_ms, _ = WATCHDOG.request.unpack(request.payload)
        if timeout_ms > 0:
            self.contact.arm(timeout_ms * 1e-3, request.first_sent)
        else:
            self.contact.disarm()

    def _damaged(self, message: Message, request: Request, now: float) -> None:
        """A frame whose 00 was hit runs into the next one and its CRC still fits: only its length shows it."""
        self.counters.damaged += 1
        request.damaged = message
        request.times_damaged += 1
        if message.axis == BAD_LENGTH:
            self._repeat(request, now)

    def _late(self, message: Message, now: float) -> None:
        self.counters.late_replies += 1
        if message.sequence not in self._live:
            self._sequence_numbers.late(message.sequence, now)
            self._abandoned = [slot for slot in self._abandoned if slot.sequence != message.sequence]

    def _event(self, message: Message) -> None:
        if self.state is not State.OPEN:
            self.counters.events_dropped += 1
            return
        if self.event_size not in (None, len(message.payload)):
            # Not acknowledged, it comes again whole.
            self.counters.damaged += 1
            return
        self._host.send(encode_frame(acknowledge(message)))
        event = self._inbox.accept(message)
        if event is None:
            self.counters.events_repeated += 1
        else:
            self.counters.events += 1
            self._host.deliver(event)

    def _overdue(self, request: Request, now: float) -> None:
        stuck = self._host.dequeue(request.frame)
        overruled = request.moves and self._queue.has_stop()
        if overruled:
            self._withdraw(request, now, "for a stop")
        elif request.repeatable and not stuck:
            self._repeat(request, now)
        else:
            gone = request.sendings > 1 or not stuck
            self._gave_up = True
            reason = f"no answer to {request.sendings} sendings" if gone else "the port takes no bytes"
            self._end(request, now, self._errors.unanswered(request, reason, gone))

    def _repeat(self, request: Request, now: float) -> None:
        request.sendings += 1
        self.counters.repeats += 1
        self._put_on_line(request, now)

    def _withdraw(self, request: Request, now: float, reason: str) -> None:
        gone = request.sendings > 0
        if gone and self._host.dequeue(request.frame):
            gone = request.sendings > 1
        if gone:
            self._abandon(request, now)
        self._end(request, now, self._errors.withdrawn(request, gone, reason))

    def _abandon(self, request: Request, now: float) -> None:
        self._end(request, now, None)
        self._abandoned.append(request)

    def _fall_silent(self, now: float, reason: str) -> None:
        """Nothing but HELLO and EMERGENCY_STOP from now on; what is under way of these goes on."""
        self._unanswered_since = None
        for request in [*self._live.values(), *self._queue]:
            if request.operation not in (HELLO, EMERGENCY_STOP):
                self._end(request, now, self._errors.silent(request, reason))
        if self.state is State.HANDSHAKE:
            self._before = State.SILENT
        elif self.state is not State.SILENT:
            self.state = State.SILENT
            self._host.lost(DeviceSilent(f"device {self.address:02X}H {reason}"))

    def _drop_queue(self, reason: str) -> None:
        for request in [r for r in self._queue if r.operation not in (HELLO, EMERGENCY_STOP)]:
            self._queue.remove(request)
            self._host.finish(request, self._errors.unanswered(request, reason, False))

    def _end(self, request: Request, now: float, error: MedusaError | None) -> None:
        """Take a request out of the queue or the window, unanswered; without `error` nobody is notified."""
        if self._live.get(request.sequence) is request:
            del self._live[request.sequence]
            self._sequence_numbers.abandoned(request.sequence, now, request.sendings)
            if request.operation is HELLO and self.state is State.HANDSHAKE:
                self.state = self._before
                self._drop_queue("HELLO was not answered")
        elif request in self._queue:
            self._queue.remove(request)
        if error is not None:
            self._host.finish(request, error)
