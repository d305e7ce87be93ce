"""The visual controller of thesis figure 6.9: a discrete PID on the retinal error."""

from dataclasses import dataclass


@dataclass(frozen=True)
class Gains:
    """Parallel form: u = K_P e + K_I Σe + K_D (e − e₋₁).

    The thesis prints no form for the gaze loop; table 6.4 has the values.
    """

    proportional: float
    integral: float = 0.0
    derivative: float = 0.0


# Thesis table 6.4.
TABLE_6_4 = {
    "i": Gains(0.5),
    "ii": Gains(0.75),
    "iii": Gains(1.0),
    "iv": Gains(0.75, 0.1),
    "v": Gains(0.75, 0.1, 0.2),
    "vi": Gains(0.75, 0.0, 0.2),
}


class Pid:
    """u = K_P e + K_I Σe + K_D (e − e₋₁), one step a picture."""

    def __init__(self, gains: Gains) -> None:
        self._gains = gains
        self._sum = 0.0
        self._last: float | None = None

    def step(self, error: float) -> float:
        self._sum += error
        difference = 0.0 if self._last is None else error - self._last
        self._last = error
        return (
            self._gains.proportional * error
            + self._gains.integral * self._sum
            + self._gains.derivative * difference
        )

    def forget_sum(self) -> None:
        """Zero the integral: what was summed for one mode of the joint is not an angle of another."""
        self._sum = 0.0

    def reset(self) -> None:
        """Forget everything, as at the first picture."""
        self._sum, self._last = 0.0, None
