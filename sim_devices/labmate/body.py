"""The body on the floor: drive, true geometry, contacts; advanced in long exact steps."""

from dataclasses import dataclass
from math import cos, inf, log, radians, sin
from typing import NamedTuple

from sim_devices.labmate.config import BaseConfig, Box
from sim_devices.labmate.floor import Contact, Floor, Outline
from sim_devices.labmate.reference import TIME_CONSTANT, Channel, still
from sim_devices.labmate.wheels import wheels_of

NOMINAL_WHEEL_BASE = 0.340
REST_SPEED = 0.001
STALL_S = 0.3
"""Ours: the wheels are held for so long against a reference before the base calls it a stall."""

FRONT, REAR, LEFT, RIGHT = 1, 2, 4, 8
SIDES = {"front": FRONT, "rear": REAR, "left": LEFT, "right": RIGHT}

_UNEVEN_STEP_S = 0.01
_CONTACT_STEP_S = 1e-4
_HELD_STEP_S = 5e-3
_RELEASE_STEP_S = 5e-3
_WAKE_S = 5e-3
_TOUCH = 1e-4


class Pose(NamedTuple):
    """Metres and radians, the heading not wrapped."""

    x: float
    y: float
    heading: float

    def moved(self, way: float, turn: float) -> "Pose":
        """Return the pose after an arc of a length and a turn: exact for constant curvature."""
        half = turn / 2
        chord = way * (sin(half) / half if abs(half) > 1e-9 else 1.0)
        middle = self.heading + half
        return Pose(self.x + chord * cos(middle), self.y + chord * sin(middle), self.heading + turn)


@dataclass(frozen=True, slots=True)
class Happening:
    """What the body noticed at its present time: newly pressed bumpers, a stall, that it came to rest."""

    pressed: int = 0
    stalled: bool = False
    rested: bool = False


class Body:
    """A base with wheels, outline and floor. `forward` and `turning` are the two speed references (m/s, rad/s).

    Between the breaks of the references both ways have closed forms; where their ratio is constant so has the
    pose, elsewhere steps of 10 ms follow arcs.
    """

    def __init__(self, config: BaseConfig) -> None:
        self.now = 0.0
        self.forward = Channel()
        self.turning = Channel()
        self.odometry = Pose(0.0, 0.0, 0.0)
        self.true = Pose(config.start_x, config.start_y, radians(config.start_heading_deg))
        self.wheels = wheels_of(config)
        self.floor = Floor(config.walls, config.boxes)
        self.hand_pressed = 0
        self.broken_bumpers = 0
        self.wheels_held = False
        self._wheel_base = config.wheel_base
        self.outline = Outline(config)
        self.touched_at: float | None = None
        """When the body first met anything that stands or walks about."""
        self._pressed = 0
        self._held_since = inf
        self._check_at = 0.0
        self._contact = Contact((inf,) * 4, inf)
        self.look()

    @property
    def at_rest(self) -> bool:
        """Whether both wheels stand."""
        return self.forward.speed == 0 and self.turning.speed == 0

    @property
    def unmoved(self) -> bool:
        """Whether both wheels stand and both references are zero to stay."""
        return self.at_rest and still((self.forward, self.turning))

    @property
    def held(self) -> bool:
        """Whether something keeps the wheels from following their reference."""
        return self._held_since < inf

    @property
    def pressed(self) -> int:
        """The bumpers that are pressed now."""
        return self._pressed

    def stop_at_once(self) -> None:
        """Make both references zero without a ramp."""
        self.forward.zero()
        self.turning.zero()

    def rest_time(self) -> float:
        """When both wheels will rest: e^{−t/τ} of the present speed under 1 mm/s; infinity before the ramp ends."""
        if not still((self.forward, self.turning)):
            return inf
        if self.at_rest:
            return self.now
        speed = self._wheel_speed()
        return self.now + TIME_CONSTANT * log(speed / REST_SPEED) if speed > REST_SPEED else self.now

    def next_time(self) -> float:
        """When it is worth looking at the body next: a reference breaks, it rests, meets something or stalls."""
        if self.unmoved:
            return max(self._check_at, self.now + _WAKE_S) if self.floor.walkers else inf
        due = min(self.forward.next_break, self.turning.next_break, self.rest_time())
        if not self.floor.empty:
            due = min(due, max(self._check_at, self.now + _WAKE_S))
        if self.held:
            due = min(due, self._held_since + STALL_S)
        elif self.wheels_held:
            due = self.now + _HELD_STEP_S
        return max(due, self.now)

    def look(self) -> Happening:
        """Measure the distances to the surroundings; return newly pressed bumpers."""
        if self.floor.empty:
            self._contact = Contact((inf,) * 4, inf)
            pressed = self.hand_pressed
        else:
            self._contact = self.outline.contact(self.floor, *self.true, self.now)
            touched = sum(1 << n for n, distance in enumerate(self._contact.bumpers) if distance == 0)
            if touched:
                self._touch()
            pressed = touched & ~self.broken_bumpers | self.hand_pressed
            self._plan_check()
        new = pressed & ~self._pressed
        self._pressed = pressed
        return Happening(pressed=new)

    def replanned(self) -> None:
        """Measure again how soon anything can be reached: the references were changed."""
        self._check_at = self.now

    def room_for(self, box: Box) -> bool:
        """Whether a box would leave the frame clear."""
        floor = Floor(boxes=[box])
        return self.outline.contact(floor, *self.true, self.now).frame > 0

    def advance_to(self, t: float) -> Happening | None:
        """Advance up to t, or to the first thing that happens before; `now` says which."""
        while self.now < t:
            happening = self._wait(t) if self.unmoved else self._step(min(t, self._step_end()))
            if happening is not None:
                return happening
        return None

    def _wait(self, t: float) -> Happening | None:
        """Stand until t, or until somebody who walks about can be here."""
        if not self.floor.walkers:
            self.now = t
            return None
        self.now = min(t, max(self._check_at, self.now + _CONTACT_STEP_S))
        pressed = self.look().pressed if self.now >= self._check_at else 0
        return Happening(pressed) if pressed else None

    def _step_end(self) -> float:
        forward, turning = self.forward, self.turning
        end = min(forward.next_break, turning.next_break, self.rest_time())
        both = forward.bound > 0 and turning.bound > 0
        if both and not (forward.settled and turning.settled):
            end = min(end, self.now + _UNEVEN_STEP_S)
        even = min(wheel.even_way() for wheel in self.wheels.values())
        if even < inf:
            even_s = even / (forward.bound + turning.bound * NOMINAL_WHEEL_BASE / 2)
            end = min(end, self.now + max(even_s, _UNEVEN_STEP_S))
        if self.held or self.wheels_held:
            end = min(end, self.now + _HELD_STEP_S, self._held_since + STALL_S)
        elif not self.floor.empty:
            end = min(end, max(self._check_at, self.now + _CONTACT_STEP_S))
        # A break that lies a rounding ahead still moves the clock.
        return max(end, self.now + 1e-9)

    def _step(self, end: float) -> Happening | None:
        before = self.true, self.odometry, self.wheels["left"].rolled, self.wheels["right"].rolled
        gap = self._frame_gap() if self._contact.frame < _TOUCH else inf
        self._roll(end - self.now)
        self.now = end
        if self.wheels_held or (gap < _TOUCH and self._frame_gap() < gap):
            self.true, self.odometry, self.wheels["left"].rolled, self.wheels["right"].rolled = before
            self.forward.speed = self.turning.speed = 0.0
            self._held_since = min(self._held_since, end)
            if not self.wheels_held:
                self._touch()
        else:
            self._held_since = inf
        rested = False
        if still((self.forward, self.turning)):
            self._held_since = inf
            rested = self._wheel_speed() <= REST_SPEED * (1 + 1e-9)
            if rested:
                self.forward.speed = self.turning.speed = 0.0
        stalled = end >= self._held_since + STALL_S
        if stalled:
            self._held_since = inf
        pressed = 0
        if not self.floor.empty and not self.held and end >= self._check_at:
            pressed = self.look().pressed
        return Happening(pressed, stalled, rested) if pressed or stalled or rested else None

    def _roll(self, duration: float) -> None:
        left, right = self.wheels["left"], self.wheels["right"]
        before_left, before_right = left.true_way(), right.true_way()
        way = self.forward.step(self.now, duration)
        turn = self.turning.step(self.now, duration)
        self.odometry = self.odometry.moved(way, turn)
        half = turn * NOMINAL_WHEEL_BASE / 2
        left.rolled += way - half
        right.rolled += way + half
        went_left, went_right = left.true_way() - before_left, right.true_way() - before_right
        self.true = self.true.moved((went_left + went_right) / 2, (went_right - went_left) / self._wheel_base)

    def _touch(self) -> None:
        if self.touched_at is None:
            self.touched_at = self.now

    def _frame_gap(self) -> float:
        return self.outline.contact(self.floor, *self.true, self.now).frame

    def _wheel_speed(self) -> float:
        return abs(self.forward.speed) + abs(self.turning.speed) * NOMINAL_WHEEL_BASE / 2

    def _plan_check(self) -> None:
        """Nothing comes nearer faster than v + ω r (1 % for the true geometry) and who walks about."""
        speed = 1.01 * (self.forward.bound + self.turning.bound * self.outline.radius)
        speed += self.floor.top_speed
        clear = min(
            self._contact.frame,
            *(distance for distance in self._contact.bumpers if distance > 0),
        )
        self._check_at = self.now + clear / speed if speed > 0 else inf
        if self._pressed & ~self.hand_pressed:
            self._check_at = min(self._check_at, self.now + _RELEASE_STEP_S)
