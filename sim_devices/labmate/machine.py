"""A Labmate on the bench: its line, its true state, and what can be done to it."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

from sim_devices.labmate.base import Base
from sim_devices.labmate.body import SIDES, Pose
from sim_devices.labmate.config import BaseConfig, Box
from sim_devices.labmate.floor import Floor, Walker
from sim_devices.labmate.wheels import WheelOnFloor
from sim_devices.link.device import LinkDevice, first_boot_count
from sim_devices.link.line import Device


class BaseMachine:
    """A part of the bench on its configuration's line. The true pose is `pose(t)`, in the floor plan's axes."""

    def __init__(self, config: BaseConfig | None = None, seed: int | None = None) -> None:
        self.config = config or BaseConfig()
        self.base = Base(self.config)
        self.device = LinkDevice(
            self.config.address,
            self.base,
            boot_count=first_boot_count(seed, self.config.address),
        )
        self._body = self.base.motion.body
        self.verbs: Mapping[str, Callable[..., Any]] = {
            "bump": self.bump,
            "slip": self.slip,
            "press_emergency_stop": self.press_emergency_stop,
            "release_emergency_stop": self.release_emergency_stop,
            "press_bumper": self.press_bumper,
            "release_bumper": self.release_bumper,
            "break_bumper": self.break_bumper,
            "hold_wheels": self.hold_wheels,
            "drain_battery": self.drain_battery,
            "place_box": self.place_box,
            "clear_floor": self.clear_floor,
            "restart": self.restart,
        }

    def power_up(self, t: float) -> None:
        """Switch the base on at t."""
        self.device.power_up(t)

    def lines(self) -> Mapping[str, Sequence[Device]]:
        """Return the base on its line."""
        return {self.config.line: [self.device]}

    def advance_to(self, t: float) -> None:
        """Run up to t."""
        self.device.advance_to(t)

    def pose(self, t: float) -> Pose:
        """Return the true pose at t: x, y (m), heading (rad, not wrapped). A t in the past gives the present."""
        self.advance_to(t)
        return self._body.true

    def clearance(self, t: float, floor: Floor | None = None) -> float:
        """Return how far the body is from its surroundings at t, or from another floor's, m."""
        pose = self.pose(t)
        return self._body.outline.clearance(floor or self._body.floor, *pose, self._body.now)

    @property
    def touched_at(self) -> float | None:
        """When the body first met anything; None as long as it has not."""
        return self._body.touched_at

    def let_walk(self, walkers: Iterable[Walker]) -> None:
        """Let people walk about the base: they press its bumpers and hold nothing."""
        self._body.floor.walkers.extend(walkers)
        self.base.motion.look()

    def state(self) -> dict[str, Any]:
        """Return truth and belief side by side; m, rad, m/s, rad/s, V, A."""
        body, motion = self._body, self.base.motion
        left, right = self.base.counts()
        return {
            "pose": body.true._asdict(),
            "odometry": body.odometry._asdict(),
            "speed": body.forward.speed,
            "turn_rate": body.turning.speed,
            "left_counts": left,
            "right_counts": right,
            "mode": motion.mode.name.lower(),
            "bumpers": [side for side, bit in SIDES.items() if body.pressed & bit],
            "emergency_stop": motion.emergency_latched,
            "stalled": motion.stall_latched,
            "battery_volts": motion.battery.volts,
            "current": motion.amperes(),
            "boot_count": self.device.boot_count,
        }

    def bump(self, wheel: str, height: float = 0.010) -> None:
        """Lay a round obstacle of a height (m) before a wheel, in the direction in which it rolls."""
        if not 0 < height < 0.07:
            raise ValueError(f"height is {height}, must be above 0 and below 0.07 m")
        rolling = self._wheel(wheel)
        rolling.add_bump(rolling.rolled, height, self._direction(wheel))

    def slip(self, wheel: str, distance: float) -> None:
        """Let a wheel spin on the spot for a distance (m), as soon as it rolls on."""
        if not 0 < distance < 10:
            raise ValueError(f"distance is {distance}, must be above 0 and below 10 m")
        self._wheel(wheel).add_slip(distance, self._direction(wheel))

    def press_emergency_stop(self) -> None:
        """Press the button on the base: the stop stays latched until the button is released and cleared."""
        self.base.motion.button_held = True
        self.base.emergency_stop()

    def release_emergency_stop(self) -> None:
        """Release the button; the stop stays latched until CLEAR."""
        self.base.motion.button_held = False

    def press_bumper(self, side: str) -> None:
        """Press a bumper by hand."""
        self._body.hand_pressed |= self._side(side)
        self.base.motion.look()

    def release_bumper(self, side: str) -> None:
        """Let a bumper go."""
        self._body.hand_pressed &= ~self._side(side)
        self.base.motion.look()

    def break_bumper(self, side: str, broken: bool = True) -> None:
        """Let a bumper notice nothing any more."""
        if broken:
            self._body.broken_bumpers |= self._side(side)
        else:
            self._body.broken_bumpers &= ~self._side(side)
        self.base.motion.look()

    def hold_wheels(self, held: bool = True) -> None:
        """Keep the wheels from turning: against a reference that is a stall."""
        self._body.wheels_held = held

    def drain_battery(self, volts: float) -> None:
        """Set the battery's voltage."""
        if not 0 <= volts <= 65:
            raise ValueError(f"volts is {volts}, must be from 0 to 65")
        self.base.motion.set_battery(volts)

    def place_box(
        self, x: float, y: float, length: float, width: float, yaw_deg: float = 0.0, low: bool = False
    ) -> None:
        """Put a box on the floor, not into the base."""
        for name, value in (("length", length), ("width", width)):
            if not value > 0:
                raise ValueError(f"{name} is {value}, must be above 0 m")
        box = Box(x, y, length, width, yaw_deg, low)
        if not self._body.room_for(box):
            raise ValueError("the base stands there")
        self._body.floor.add(box)
        self.base.motion.look()

    def clear_floor(self) -> None:
        """Take every wall and box away."""
        self._body.floor.clear()
        self.base.motion.look()

    def restart(self) -> None:
        """Cycle the base's power."""
        self.device.restart(self._body.now)

    def _wheel(self, name: str) -> WheelOnFloor:
        for wheel, rolling in self._body.wheels.items():
            if wheel == name:
                return rolling
        raise ValueError(f"wheel is {name!r}, must be left or right")

    def _direction(self, wheel: str) -> int:
        turning = self._body.turning.speed if wheel == "right" else -self._body.turning.speed
        return -1 if self._body.forward.speed + turning * self.config.wheel_base / 2 < 0 else 1

    def _side(self, name: str) -> int:
        if name not in SIDES:
            raise ValueError(f"side is {name!r}, must be one of {', '.join(SIDES)}")
        return SIDES[name]
