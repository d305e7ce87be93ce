"""The window whose flow is measured, and the images it is cut from."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from perception.flow.errors import ImageError, SettingError

Image = NDArray[np.uint8]

LEAST_WIDTH, LEAST_HEIGHT = 24, 8


@dataclass(frozen=True, slots=True)
class Window:
    """A rectangle of pixels: its left column and top row, its width and height."""

    left: int
    top: int
    width: int = 64
    height: int = 32

    def __post_init__(self) -> None:
        if self.left < 0 or self.top < 0:
            raise SettingError(f"window at column {self.left}, row {self.top}: both must be at least 0")
        if self.width < LEAST_WIDTH or self.height < LEAST_HEIGHT:
            raise SettingError(
                f"window of {self.width}×{self.height} pixels: at least {LEAST_WIDTH}×{LEAST_HEIGHT} are needed"
            )

    @classmethod
    def centred(cls, image_width: int, image_height: int, width: int = 64, height: int = 32) -> "Window":
        """The window in the middle of an image; raises SettingError when it does not fit."""
        if width > image_width or height > image_height:
            raise SettingError(
                f"window of {width}×{height} pixels in an image of {image_width}×{image_height}: it does not fit"
            )
        return cls((image_width - width) // 2, (image_height - height) // 2, width, height)

    @property
    def middle(self) -> float:
        """The column in its middle, where its flow is stated."""
        return self.left + (self.width - 1) / 2


def check_image(image: Image, window: Window) -> None:
    """Refuse an image that is not grey, not of 8 bits, or does not hold the window; raises ImageError."""
    if image.ndim != 2:
        raise ImageError(f"image of shape {image.shape}: a grey one, (height, width), is needed")
    if image.dtype != np.uint8:
        raise ImageError(f"image of {image.dtype}: grey levels 0 to 255 in uint8 are needed")
    height, width = image.shape
    if window.left + window.width > width or window.top + window.height > height:
        raise ImageError(
            f"image of {width}×{height} pixels does not hold the window of {window.width}×{window.height}"
            f" at column {window.left}, row {window.top}"
        )


@dataclass(frozen=True, slots=True)
class WindowFlow:
    """Horizontal flow in the middle of a window, px, positive to the right; NaN where unknown.

    texture: whether there is one; a flow can be unknown though, where it is ambiguous or out of reach.
    """

    flow_px: float
    deviation_px: float
    texture: bool
