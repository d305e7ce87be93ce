"""The map as a textured point cloud in a PLY file."""

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from perception.depth.filter.inverse_depth import InverseDepth
from perception.depth.geometry.pinhole import Pinhole

Field = NDArray[np.float32]
VERTEX = np.dtype([("x", "<f4"), ("y", "<f4"), ("z", "<f4"), ("red", "u1"), ("green", "u1"), ("blue", "u1")])


def write_ply(
    path: Path, camera: Pinhole, state: InverseDepth, image: NDArray[np.uint8], uncertainty: float = 0.2
) -> int:
    """Write the points whose σ_Z/Z is at most `uncertainty`, in metres.

    They are in the map's camera frame: x right, y down, z forward.

    Args:
        image: the map's view, grey or BGR, which gives the points their colour.

    Returns:
        The number of points.
    """
    with np.errstate(divide="ignore", invalid="ignore"):
        relative = np.sqrt(state.variance) / state.value
    rows, columns = np.nonzero(np.isfinite(state.value) & (state.value > 0) & (relative <= uncertainty))
    depth = 1 / state.value[rows, columns]
    points = np.empty(len(rows), VERTEX)
    points["x"] = (columns - camera.cx) / camera.fx * depth
    points["y"] = (rows - camera.cy) / camera.fy * depth
    points["z"] = depth
    colour = image[rows, columns]
    for place, name in enumerate(("blue", "green", "red")):
        points[name] = colour if image.ndim == 2 else colour[:, place]
    header = ["ply", "format binary_little_endian 1.0", f"element vertex {len(points)}"]
    header += [f"property {'float' if name in 'xyz' else 'uchar'} {name}" for name in VERTEX.names or ()]
    with path.open("wb") as file:
        file.write(("\n".join([*header, "end_header"]) + "\n").encode("ascii"))
        file.write(points.tobytes())
    return len(points)
