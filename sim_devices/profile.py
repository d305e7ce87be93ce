"""The trapezoidal profile of a servo board, in exact integer arithmetic."""

from math import isqrt


class Trapezoid:
    """Counts gone at the n-th sample after the start (n = 0: none yet).

    D counts to go, a = A/256 and v as written: n_a = min(v/a, √(D/a)), v_p = a n_a, N = D/v_p + n_a;
    s(n) = a n²/2 up to n_a, then v_p a sample, from N − n_a on D − a (N − n)²/2 (the board's protocol page).
    Every floor is that of the true value: no rounding of floats comes in.
    """

    def __init__(self, start: int, final: int, acceleration_256: int, maximum: int) -> None:
        """Plan from `start` to `final` in counts, with A/256 counts/sample² and `maximum` counts/sample."""
        self.start = start
        self.sign = 1 if final >= start else -1
        distance = abs(final - start)
        if distance and (acceleration_256 <= 0 or maximum <= 0):
            raise ValueError(
                f"acceleration {acceleration_256}/256 and maximum {maximum}: both must be above 0 to go {distance}"
            )
        self.distance = distance
        self._a = a = acceleration_256
        self._v = v = maximum
        self.stopped = False
        self._stop_at = 0
        self._stop_in_cruise = False
        self.triangular = a * distance < 256 * v * v
        if distance == 0:
            self.rise = self.cruise_end = self.last = 0
        elif self.triangular:
            self.rise = self.cruise_end = isqrt(256 * distance // a)
            root = isqrt(1024 * distance // a)
            self.last = root if root * root * a == 1024 * distance else root + 1
        else:
            self.rise = 256 * v // a
            self.cruise_end = distance // v
            self.last = -(-(a * distance + 256 * v * v) // (a * v))

    def gone(self, n: int) -> int:
        """Return ⌊s(n)⌋ ≥ 0, from `last` on the final value."""
        a, v = self._a, self._v
        if n >= self.last:
            return self.distance
        if n <= 0:
            return 0
        if self.stopped and n > self._stop_at:
            return self._gone_stopping(n)
        if n <= self.rise:
            return a * n * n >> 9
        if self.triangular:
            return (isqrt(4096 * n * n * a * self.distance) - 512 * self.distance - a * n * n) // 512
        if n <= self.cruise_end:
            return (a * v * n - 128 * v * v) // a
        left = a * self.distance + 256 * v * v - a * v * n
        return self.distance - -(-left * left // (512 * a * v * v))

    def _gone_stopping(self, n: int) -> int:
        a, v, k = self._a, self._v, self._stop_at
        m = n - k
        if self._stop_in_cruise:
            return (512 * (a * v * (k + m) - 128 * v * v) - a * a * m * m) // (512 * a)
        return a * (k * k + 2 * k * m - m * m) >> 9

    def stop(self, n: int) -> None:
        """Decelerate from the n-th sample on: s(n) + ṡ(n) m − a m²/2 until m ≥ ṡ(n)/a, and rest there.

        Between the apex and the first sample after it the path stays at the apex: a stop never turns back. In the
        last stretch, and after a stop, nothing changes; before the first sample (n < 0) the move ends where it is.
        """
        if self.stopped or n >= self.last:
            return
        self.stopped = True
        self._stop_at = max(n, 0)
        if n <= 0:
            self.distance = self.last = 0
        elif n <= self.rise:
            self.distance = self._a * n * n // 256
            self.last = 2 * n
        elif n <= self.cruise_end and not self.triangular:
            self._stop_in_cruise = True
            self.distance = self._v * n
            self.last = n - (-256 * self._v // self._a)
        else:
            self._stop_at = self.last

    def command(self, n: int) -> int:
        """Return the command position at sample n, in counts."""
        return self.start + self.sign * self.gone(n)

    def commands(self, first: int, end: int) -> list[int]:
        """Return the command positions of the samples first..end−1."""
        if first >= end:
            return []
        start, sign, a, v = self.start, self.sign, self._a, self._v
        samples = range(first, end)
        if not self.stopped and first >= 0 and end <= self.last:
            if end <= self.rise:
                return [start + sign * (a * n * n >> 9) for n in samples]
            if first > self.rise and end <= self.cruise_end and not self.triangular:
                rate, lost = a * v, 128 * v * v
                return [start + sign * ((rate * n - lost) // a) for n in samples]
        return [start + sign * self.gone(n) for n in samples]
