"""What a horizontal flow says of a distance, for a camera that moves in the plane of its x and z axes.

Camera axes: x right, y down, z along the optical axis. A `CameraMotion` leads from an earlier to a later image: t, the
later camera's place in the earlier one's axes, and d, by how much it has turned, counter-clockwise seen from above (to
the left), as the heading of the body that carries it. A point that is (X, Z) to the later camera was

    X' = c X − s Z + t_x,  Z' = s X + c Z + t_z,  c = cos d, s = sin d

to the earlier one. With x = X/Z, q = X'/Z' and ρ = 1/Z:

    q = (c x − s + ρ t_x)/(s x + c + ρ t_z)  ⇔  ρ = (q (s x + c) − (c x − s))/(t_x − q t_z)

The flow in pixels is f (x − q). To first order it is f (ρ (x t_z − t_x) + (1 + x²) d): the rotation enters with a plus
(equations.md, thesis (3.9) has a minus), and u_L is negative when a left camera moves forward.
"""

from dataclasses import dataclass
from math import cos, isfinite, nan, sin, sqrt

from perception.flow.errors import MotionError

LEAST_LEVER_M = 1e-5
"""Below this lever t_x − q t_z there is no parallax, and no distance."""


@dataclass(frozen=True, slots=True)
class CameraMotion:
    """Motion of a camera from an earlier image to a later one: m and rad, with standard deviations.

    right_m, forward_m: the later place in the earlier camera's axes. turn_rad: counter-clockwise from above. The
    deviations are the odometry's over this motion; 0 when only the flow's own deviation is wanted.
    """

    right_m: float
    forward_m: float
    turn_rad: float
    right_deviation_m: float = 0.0
    forward_deviation_m: float = 0.0
    turn_deviation_rad: float = 0.0

    def check(self) -> None:
        """Refuse what is not finite; raises MotionError."""
        if not isfinite(self.right_m + self.forward_m + self.turn_rad):
            raise MotionError(
                f"camera motion {self.right_m} m right, {self.forward_m} m forward, {self.turn_rad} rad: not finite"
            )
        least = min(self.right_deviation_m, self.forward_deviation_m, self.turn_deviation_rad)
        if not least >= 0:
            raise MotionError(f"deviation of the camera's motion is {least}: it must be at least 0")

    def then(self, more: "CameraMotion") -> "CameraMotion":
        """This motion and the one after it as one; variances add, as errors are independent and turns small."""
        c, s = cos(self.turn_rad), sin(self.turn_rad)
        return CameraMotion(
            self.right_m + c * more.right_m - s * more.forward_m,
            self.forward_m + s * more.right_m + c * more.forward_m,
            self.turn_rad + more.turn_rad,
            sqrt(self.right_deviation_m**2 + more.right_deviation_m**2),
            sqrt(self.forward_deviation_m**2 + more.forward_deviation_m**2),
            sqrt(self.turn_deviation_rad**2 + more.turn_deviation_rad**2),
        )

    def since(self, part: "CameraMotion") -> "CameraMotion":
        """What is left of this motion after its first part: part.then(motion.since(part)) is the motion."""
        c, s = cos(part.turn_rad), sin(part.turn_rad)
        right, forward = self.right_m - part.right_m, self.forward_m - part.forward_m
        return CameraMotion(
            c * right + s * forward,
            c * forward - s * right,
            self.turn_rad - part.turn_rad,
            sqrt(max(self.right_deviation_m**2 - part.right_deviation_m**2, 0.0)),
            sqrt(max(self.forward_deviation_m**2 - part.forward_deviation_m**2, 0.0)),
            sqrt(max(self.turn_deviation_rad**2 - part.turn_deviation_rad**2, 0.0)),
        )


STILL = CameraMotion(0.0, 0.0, 0.0)


@dataclass(frozen=True, slots=True)
class Mounting:
    """Where a camera sits on the body that carries it, x forward, y left: m, and its optical axis, rad from forward
    to the left: +π/2 for a camera that looks to the left."""

    forward_m: float
    left_m: float
    yaw_rad: float

    def motion(
        self,
        forward_m: float,
        left_m: float,
        turn_rad: float,
        deviations: tuple[float, float, float] = (0.0, 0.0, 0.0),
    ) -> CameraMotion:
        """The camera's motion from the body's: the body's later place in its earlier axes and how far it turned.

        Args:
            deviations: standard deviations of the three, taken to be independent.
        """
        c, s = cos(turn_rad), sin(turn_rad)
        ahead = forward_m + (c - 1) * self.forward_m - s * self.left_m
        aside = left_m + s * self.forward_m + (c - 1) * self.left_m
        c, s = cos(self.yaw_rad), sin(self.yaw_rad)
        by_turn = -self.left_m, self.forward_m
        along, across, turn = deviations
        return CameraMotion(
            s * ahead - c * aside,
            c * ahead + s * aside,
            turn_rad,
            sqrt((s * along) ** 2 + (c * across) ** 2 + ((s * by_turn[0] - c * by_turn[1]) * turn) ** 2),
            sqrt((c * along) ** 2 + (s * across) ** 2 + ((c * by_turn[0] + s * by_turn[1]) * turn) ** 2),
            turn,
        )


@dataclass(frozen=True, slots=True)
class Ray:
    """The direction in which a window's middle looks: x = X/Z, and the focal length in px."""

    x: float
    focal_px: float

    def predict_flow(self, inverse_depth: float, motion: CameraMotion) -> tuple[float, float]:
        """f (x − q) of a point that the later camera sees here at 1/Z, and what of it is parallax, px.

        q₀ − q = ρ (q₀ t_z − t_x)/(s x + c + ρ t_z), q₀ = (c x − s)/(s x + c) where an infinitely far point was. NaN
        when it was behind the earlier camera.
        """
        x, c, s = self.x, cos(motion.turn_rad), sin(motion.turn_rad)
        depth = s * x + c
        was_deep = depth + inverse_depth * motion.forward_m
        if not (depth > 0 and was_deep > 0):
            return nan, nan
        far = (c * x - s) / depth
        parallax = inverse_depth * (far * motion.forward_m - motion.right_m) / was_deep
        return self.focal_px * (x - far + parallax), self.focal_px * parallax

    def estimate_inverse_depth(
        self, flow_px: float, deviation_px: float, motion: CameraMotion
    ) -> tuple[float, float]:
        """1/Z to the later camera of what it sees here, and its standard deviation, 1/m; NaN without parallax."""
        x, c, s = self.x, cos(motion.turn_rad), sin(motion.turn_rad)
        q = x - flow_px / self.focal_px
        lever = motion.right_m - q * motion.forward_m
        if not abs(lever) >= LEAST_LEVER_M:
            return nan, nan
        depth, aside = s * x + c, c * x - s
        value = (q * depth - aside) / lever
        by_flow = (depth + value * motion.forward_m) / lever * deviation_px / self.focal_px
        by_right = value / lever * motion.right_deviation_m
        by_forward = value * q / lever * motion.forward_deviation_m
        by_turn = (q * aside + depth) / lever * motion.turn_deviation_rad
        return value, sqrt(by_flow**2 + by_right**2 + by_forward**2 + by_turn**2)

    def flow_range(self, nearest_m: float, most_px: float, motion: CameraMotion) -> tuple[float, float]:
        """The least and the greatest shift of walls from `nearest_m` to infinity, at most `most_px` to each side."""
        ends = [self.predict_flow(depth, motion)[0] for depth in (0.0, 1 / nearest_m)]
        if not all(isfinite(end) for end in ends):
            return -most_px, most_px
        least, most = (min(max(end, -most_px), most_px) for end in (min(ends), max(ends)))
        return least, most

    def turned(self, by: float) -> "Ray":
        """The direction `by` to the right of this one."""
        return Ray(self.x + by, self.focal_px)
