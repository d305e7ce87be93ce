"""An image worked through in bands of rows, several at a time.

NumPy leaves all processors but one idle; as it and OpenCV let go of the interpreter, threads need not. A band with the
rows around it that its filters look at, its halo, gives the same bits as the whole.
"""

import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import cache
from threading import Lock, local
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

Item = TypeVar("Item")
PIXELS = 1 << 17
"""Most pixels of a band. Smaller ones fit the cache better, but what their halos add costs more."""
ALONE = 1 << 16
"""An image of fewer pixels is done before a second thread has woken."""
STEP = 12
"""Bands begin at multiples of this many rows, so that every second or third row is the same in band and whole."""
MOST_THREADS = 4
"""More would wait for the interpreter."""


@dataclass(frozen=True)
class Band:
    """Rows of an image: those to work with, those of them to keep, and where the latter lie in the former."""

    outer: slice
    inner: slice
    trim: slice


def bands(shape: tuple[int, int], halo: int = 0) -> list[Band]:
    """The bands of an image of `shape`, each with `halo` more rows on both sides as far as there are any.

    They depend on nothing but the shape, so that a result cannot depend on the machine.
    """
    height, width = shape
    # An even number of them, for two processors.
    number = 2 * -(-height * width // (2 * PIXELS)) if height * width >= ALONE else 1
    rows = STEP * -(-height // (number * STEP))
    return [
        Band(
            slice(max(top - halo, 0), min(top + rows + halo, height)),
            slice(top, min(top + rows, height)),
            slice(min(halo, top), min(halo, top) + min(rows, height - top)),
        )
        for top in range(0, height, rows)
    ]


def share(work: Callable[[Item], None], items: Iterable[Item], pixels: int = ALONE) -> None:
    """Do the work for every item, several at a time, and wait for all.

    Work on images of few `pixels` is done in turn; so is work that shares its own, for it would wait for the thread
    it runs in.
    """
    if pixels < ALONE or _threads() == 1 or getattr(_here, "shared", False):
        for item in items:
            work(item)
    else:
        for _ in _pool().map(work, items):
            pass


def join_bands(
    shape: tuple[int, int], work: Callable[[Band], tuple[NDArray[Any], ...]], halo: int = 0
) -> tuple[NDArray[Any], ...]:
    """What the work makes of every band, its inner rows alone, put together to whole images."""
    wholes: list[NDArray[Any]] = []
    lock = Lock()

    def place(band: Band) -> None:
        parts = work(band)
        with lock:
            if not wholes:
                wholes.extend(np.empty((shape[0], *part.shape[1:]), part.dtype) for part in parts)
        for whole, part in zip(wholes, parts, strict=True):
            whole[band.inner] = part

    share(place, bands(shape, halo), shape[0] * shape[1])
    return tuple(wholes)


def _threads() -> int:
    mine = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    return min(mine, MOST_THREADS)


@cache
def _pool() -> ThreadPoolExecutor:
    return ThreadPoolExecutor(_threads(), "depth", lambda: setattr(_here, "shared", True))


_here = local()
