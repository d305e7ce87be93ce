"""The part of an image in which a plane is seen, cut into square blocks."""

from dataclasses import dataclass
from functools import cache, cached_property

import numpy as np
from numpy.typing import NDArray

from perception.plane.errors import PlaneError

Field = NDArray[np.float32]
Matrix = NDArray[np.float64]


@dataclass(frozen=True)
class Window:
    """A rectangle of pixels; its sides are whole numbers of blocks."""

    left: int
    top: int
    columns: int
    """Blocks in a row."""
    rows: int
    block: int
    """Side of a block in pixels."""

    @classmethod
    def central(cls, shape: tuple[int, ...], width: int, height: int, block: int = 8) -> "Window":
        """The window of at most `width` × `height` pixels in the middle of an image of (height, width, …).

        Raises:
            PlaneError: it leaves the image, or holds fewer than three blocks a side.
        """
        columns, rows = width // block, height // block
        if width > shape[1] or height > shape[0] or min(columns, rows) < 3:
            raise PlaneError(
                f"a window of {width}×{height} pixels in an image of {shape[1]}×{shape[0]}:"
                f" it must lie inside and be at least {3 * block} pixels wide and high"
            )
        return cls((shape[1] - columns * block) // 2, (shape[0] - rows * block) // 2, columns, rows, block)

    @property
    def width(self) -> int:
        """Pixels in a row."""
        return self.columns * self.block

    @property
    def height(self) -> int:
        """Pixels in a column."""
        return self.rows * self.block

    @property
    def count(self) -> int:
        """How many blocks there are."""
        return self.columns * self.rows

    @property
    def part(self) -> tuple[slice, slice]:
        """Its rows and columns of an image."""
        return slice(self.top, self.top + self.height), slice(self.left, self.left + self.width)

    @property
    def half(self) -> float:
        """Half the longer side in pixels: the unit of the window's coordinates."""
        return max(self.width, self.height) / 2

    @cached_property
    def to_pixels(self) -> Matrix:
        """From window coordinates, −1 to 1 along the longer side from the centre, to pixels (3 × 3)."""
        x, y = self.left + (self.width - 1) / 2, self.top + (self.height - 1) / 2
        return np.array([[self.half, 0.0, x], [0.0, self.half, y], [0.0, 0.0, 1.0]])

    @cached_property
    def from_pixels(self) -> Matrix:
        """The inverse of `to_pixels`."""
        return np.asarray(np.linalg.inv(self.to_pixels))

    def halved(self) -> "Window":
        """About the same part of the image of half the size, in blocks of half the side, at least 4 pixels."""
        block = max(self.block // 2, 4)
        columns, rows = self.width // (2 * block), self.height // (2 * block)
        return Window(self.left // 2, self.top // 2, columns, rows, block)

    def inside(self, shape: tuple[int, ...]) -> bool:
        """Whether an image of (height, width) holds it."""
        bottom, right = self.top + self.height, self.left + self.width
        return min(self.left, self.top) >= 0 and bottom <= shape[0] and right <= shape[1]

    def by_blocks(self, field: Field) -> Field:
        """The window's pixels of a field (height × width of the window), block by block: blocks × pixels."""
        tiles = field.reshape(self.rows, self.block, self.columns, self.block).transpose(0, 2, 1, 3)
        return np.ascontiguousarray(tiles).reshape(self.count, -1)

    def from_blocks(self, blocks: Field) -> Field:
        """A field (height × width of the window) of its pixels block by block: what `by_blocks` took apart."""
        tiles = blocks.reshape(self.rows, self.columns, self.block, self.block).transpose(0, 2, 1, 3)
        return np.ascontiguousarray(tiles).reshape(self.height, self.width)

    def pixels(self) -> tuple[Matrix, Matrix]:
        """Columns and rows of its pixels in the image, height × width each."""
        x, y = np.meshgrid(np.arange(self.width, dtype=float), np.arange(self.height, dtype=float))
        return x + self.left, y + self.top

    def coordinates(self) -> tuple[Field, Field]:
        """Window coordinates x, y of the pixels, block by block."""
        return _coordinates(self.columns, self.rows, self.block)

    def flow_products(self) -> Matrix:
        """Σ BᵀB over the pixels of each block, a row each, with ∂x = B δ the flow of a homography I + Δ."""
        return _flow_products(self.columns, self.rows, self.block)


@cache
def _flow_products(columns: int, rows: int, block: int) -> Matrix:
    x, y = (part.astype(float) for part in _coordinates(columns, rows, block))
    one, none = np.ones_like(x), np.zeros_like(x)
    across = np.stack((one, x, y, none, none, none, -x * x, -x * y), axis=1)
    down = np.stack((none, none, none, one, x, y, -x * y, -y * y), axis=1)
    products = across @ across.transpose(0, 2, 1) + down @ down.transpose(0, 2, 1)
    return np.asarray(products.reshape(len(x), -1))


@cache
def _coordinates(columns: int, rows: int, block: int) -> tuple[Field, Field]:
    window = Window(0, 0, columns, rows, block)
    half = max(window.width, window.height) / 2
    x = (np.arange(window.width) - (window.width - 1) / 2) / half
    y = (np.arange(window.height) - (window.height - 1) / 2) / half
    wide, high = np.meshgrid(x.astype(np.float32), y.astype(np.float32))
    return window.by_blocks(wide), window.by_blocks(high)
