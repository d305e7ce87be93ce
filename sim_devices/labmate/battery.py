"""The battery: it drains with the current that standing, moving and pushing draw."""

from math import inf

LOW_VOLTS = 22.0
IDLE_AMPERES = 1.0
MOVING_AMPERES = 5.0
HELD_AMPERES = 25.0


class Battery:
    """Volts that fall with the charge drawn, `slope` volts an ampere-hour."""

    def __init__(self, volts: float, slope: float) -> None:
        self.volts = volts
        self._slope = slope / 3600

    @property
    def low(self) -> bool:
        """Whether the battery is below 22 V."""
        return self.volts < LOW_VOLTS

    def drain(self, amperes: float, duration: float) -> None:
        """Draw a current for a time (s)."""
        self.volts = max(self.volts - self._slope * amperes * duration, 0.0)

    def low_after(self, amperes: float) -> float:
        """Return in how many seconds at a current the battery is low; infinity when it is already, or never."""
        if self.low or self._slope * amperes == 0:
            return inf
        # A hair later than the crossing, so that it is then below.
        return (self.volts - LOW_VOLTS) / (self._slope * amperes) + 1e-3
