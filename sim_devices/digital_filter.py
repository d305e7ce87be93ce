"""The digital filter of the axis chip, with its 8-bit output."""


class DigitalFilter:
    """D(z) = (K/4)(z − A/256)/(z + B/256): MC[n] = (K/4)X[n] − (A/256)(K/4)X[n−1] − (B/256)MC[n−1].

    The output is truncated toward zero and clamped to −128..127, and the clamped value is what is fed back.
    Every product is a multiple of 2⁻¹⁰ below 2⁴³, so floats hold it exactly.
    """

    def __init__(self) -> None:
        self.load(0xE5, 0x40, 0x40)
        self.clear()

    def load(self, zero: int, pole: int, gain: int) -> None:
        """Take the bytes A, B and K."""
        self.zero, self.pole, self.gain = zero, pole, gain
        self.forward = gain / 4
        self.delayed = zero * gain / 1024
        self.feedback = pole / 256

    def clear(self) -> None:
        """Forget the old samples."""
        self.error = 0
        self.output = 0

    def step(self, error: int) -> int:
        """Return the motor command (−128..127) for a position error in counts."""
        output = int(self.forward * error - self.delayed * self.error - self.feedback * self.output)
        self.error = error
        self.output = output = min(max(output, -128), 127)
        return output

    def step_velocity(self, error_16: int) -> int:
        """Return the motor command MC = (K/4)Y for a velocity error in 1/16 count/sample; A and B unused."""
        self.error = 0
        self.output = output = min(max(int(self.forward * error_16 / 16), -128), 127)
        return output
