"""An image with what the match needs of it, each computed once."""

from functools import cached_property

import cv2
import numpy as np

from perception.depth.match.contrast import (
    NOISE_LEFT,
    NOISY_SHARE,
    Bytes,
    Grey,
    denoise,
    equalised_slopes,
    estimate_noise,
    noise_share,
    noise_weight,
    soften,
)
from perception.image.interpolation import InterpolatedImage


class View:
    """One image in grey levels; its noise, its variants and its slopes are computed when they are first used."""

    def __init__(self, grey: Grey) -> None:
        self.grey = grey

    @property
    def shape(self) -> tuple[int, int]:
        """Height and width."""
        return self.grey.shape[0], self.grey.shape[1]

    @cached_property
    def noise(self) -> float:
        """Standard deviation of the pixel noise in grey levels."""
        return estimate_noise(self.grey)

    @cached_property
    def noise_share(self) -> float:
        """The part of the slopes that the noise makes."""
        return noise_share(self.grey, self.noise)

    @property
    def noisy(self) -> bool:
        """Whether the noise makes much of the slopes."""
        return self.noise_share >= NOISY_SHARE

    @cached_property
    def denoised(self) -> Grey:
        """The image with its noise taken out and its edges left, if it is noisy: for the search."""
        return denoise(self.grey, self.noise) if self.noisy else self.grey

    @cached_property
    def soft(self) -> Grey:
        """The image as the error surface compares it."""
        return soften(self.grey)

    @cached_property
    def interpolated(self) -> InterpolatedImage:
        """The softened image, interpolated between its pixels."""
        return InterpolatedImage(self.soft)

    @cached_property
    def noise_weight(self) -> float:
        """By how much noise moves a match more than the variance of a pixel of `soft` suggests."""
        return noise_weight(self.soft)

    @cached_property
    def slopes(self) -> Bytes:
        """The equalised slopes, 2 × height × width."""
        return equalised_slopes(self.denoised, NOISE_LEFT * self.noise if self.noisy else self.noise)

    @cached_property
    def contrast(self) -> float:
        """Root mean square of the step between neighbours in a row, grey levels."""
        return float(np.sqrt(np.mean(np.square(np.diff(self.denoised, axis=1)))))

    @cached_property
    def halved(self) -> "View":
        """The next level of the Gaussian pyramid, thesis section 2.5."""
        height, width = self.shape
        blurred = cv2.GaussianBlur(self.grey, (0, 0), 1.0)
        small = cv2.resize(blurred, (width // 2, height // 2), interpolation=cv2.INTER_LINEAR)
        return View(np.asarray(small, np.float32))

    def level(self, number: int) -> "View":
        """The level of the pyramid, 0 the image itself; none is made smaller than 16 pixels."""
        view = self
        for _ in range(number):
            if min(view.shape) < 32:
                break
            view = view.halved
        return view
