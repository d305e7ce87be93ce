"""Freed memory kept for the next image."""

import numpy as np

KEPT = 31 << 20
"""Bytes; glibc learns from no block of 32 MB or more."""


def keep_freed_memory() -> None:
    """Let glibc keep what is freed, up to twice `KEPT`, instead of handing it back to the system.

    What it keeps grows with the greatest block that was ever freed (mallopt(3), M_MMAP_THRESHOLD), so that one is
    taken here and freed. Nobody writes to it: it costs no memory. The arrays of an image are wanted again a moment
    after they were freed, and getting their pages anew took an eighth of the time. Other allocators do not mind.
    """
    np.empty(KEPT, np.uint8)
