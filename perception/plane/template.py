"""The window of an image whose motion is sought: grey levels, what moves them, and the sums of it block by block."""

from functools import cached_property

import cv2
import numpy as np
from numpy.typing import NDArray

from perception.image.memory import keep_freed_memory
from perception.plane.errors import PlaneError
from perception.plane.window import Window

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]
SOFTNESS_PX = 0.8
"""Standard deviation of the Gaussian that takes out what the pixels are too coarse for.

With less, aliasing errs more than noise does; with more, noise."""
PIXEL_VARIANCE = 1 / 12
"""Variance of the square that a pixel averages over, px²."""
SLOPE = np.array([[1, -8, 0, 8, -1]], np.float32) / np.float32(12)
SLOPE_NOISE = 0.574
"""Variance of a slope over that of a grey level in white noise that was softened, 1/px²."""
MOTIONS = 8
"""Parameters of a homography."""
UNKNOWNS = MOTIONS + 4
"""With those of the light: gain, its slopes across and down, and an offset."""
REACH = 6
"""Pixels around a window that its filters look at."""
SMALLEST = 20
"""Pixels along the shorter side of a window that is not halved again."""
MOST_HALVINGS = 3


def soften(grey: Field, softness: float = SOFTNESS_PX) -> Field:
    """The image without what is finer than its pixels."""
    return np.asarray(cv2.GaussianBlur(grey, (0, 0), softness, borderType=cv2.BORDER_REFLECT_101), np.float32)


def halve(image: Field) -> Field:
    """The image of half the size; its pixel k lies on pixel 2k."""
    return np.asarray(cv2.pyrDown(image), np.float32)


class Level:
    """One level of the pyramid of the first image: its window, and the normal equations of each block.

    With x₂ ~ H (I + Δ) x₁, the grey levels of the second image b and the first a obey
    b(H x) − a(x) = ∇a·∂x + (g + g_x x + g_y y) a + o, linear in the eight of Δ and the four of the light. The
    coordinates are those of the window, −1 to 1.
    """

    def __init__(self, image: Field, window: Window) -> None:
        self.window = window
        left, top = max(window.left - REACH, 0), max(window.top - REACH, 0)
        bottom, right = window.top + window.height + REACH, window.left + window.width + REACH
        soft = soften(image[top:bottom, left:right])
        half = np.float32(window.half)
        across, down = (cv2.filter2D(soft, cv2.CV_32F, half * kernel) for kernel in (SLOPE, SLOPE.T))
        inner = np.s_[
            window.top - top : window.top - top + window.height,
            window.left - left : window.left - left + window.width,
        ]
        self.grey = window.by_blocks(soft[inner])
        slope_x, slope_y = (
            window.by_blocks(np.asarray(slope[inner], np.float32)) for slope in (across, down)
        )
        self.jacobian = _jacobian(self.grey, slope_x, slope_y, *window.coordinates())
        """Blocks × unknowns × pixels."""

    @cached_property
    def gram(self) -> Matrix:
        """JᵀJ of each block, blocks × unknowns²."""
        gram = self.jacobian @ self.jacobian.transpose(0, 2, 1)
        return np.asarray(gram.reshape(len(gram), -1), np.float64)

    @cached_property
    def texture(self) -> Matrix:
        """Mean |∇a|² of each block, grey²/px²."""
        shift = self.jacobian[:, (0, 3)]
        power = np.einsum("bci,bci->b", shift, shift)
        return np.asarray(power / (self.window.half**2 * self.grey.shape[1]))

    def lit(self, light: Matrix) -> Field:
        """The window's softened grey levels in other light (g, g_x, g_y, o), height × width."""
        x, y = self.window.coordinates()
        gain, across, down, offset = (np.float32(part) for part in light)
        return self.window.from_blocks(self.grey * (1 + gain + across * x + down * y) + offset)

    def slope_noise(self, weights: Matrix, variance: float) -> Matrix:
        """What noise of this variance in the softened image adds to JᵀJ of the weighted blocks, MOTIONS × MOTIONS."""
        products = (weights @ self.window.flow_products()).reshape(MOTIONS, MOTIONS)
        return np.asarray(products * (variance * SLOPE_NOISE * self.window.half**2))


def _jacobian(grey: Field, slope_x: Field, slope_y: Field, x: Field, y: Field) -> Field:
    jacobian = np.empty((grey.shape[0], UNKNOWNS, grey.shape[1]), np.float32)
    radial = x * slope_x
    radial += y * slope_y
    np.negative(radial, out=radial)
    jacobian[:, 0], jacobian[:, 3], jacobian[:, 8], jacobian[:, 11] = slope_x, slope_y, grey, 1
    products = ((slope_x, x, y), (slope_y, x, y), (radial, x, y), (grey, x, y))
    for column, (one, across, down) in zip((1, 4, 6, 9), products, strict=True):
        np.multiply(one, across, out=jacobian[:, column])
        np.multiply(one, down, out=jacobian[:, column + 1])
    return jacobian


class Template:
    """The first image of pairs: its window at every level of the pyramid, coarse levels only once they are asked for.

    A template serves all images that are compared with its own: what is computed of it is kept.
    """

    def __init__(self, image: NDArray[np.uint8] | Field, window: Window) -> None:
        """Raises PlaneError when the image is not grey or the window leaves it."""
        if image.ndim != 2 or not window.inside(image.shape):
            raise PlaneError(
                f"a grey image that holds {window} is needed, this one has the shape {image.shape}"
            )
        keep_freed_memory()
        self.shape = image.shape
        self.window = window
        self._image = np.asarray(image, np.float32)

    @cached_property
    def finest(self) -> Level:
        """The level of the image itself."""
        return Level(self._image, self.window)

    @cached_property
    def coarser(self) -> list[Level]:
        """The levels above, each of half the size of the one before, the coarsest last."""
        levels: list[Level] = []
        image, window = self._image, self.window
        while min(window.width, window.height) >= 2 * SMALLEST and len(levels) < MOST_HALVINGS:
            image, window = halve(image), window.halved()
            levels.append(Level(image, window))
        return levels
