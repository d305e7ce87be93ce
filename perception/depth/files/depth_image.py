"""The depth map as a coloured picture with its scale."""

import cv2
import numpy as np
from numpy.typing import NDArray

Field = NDArray[np.float32]
UNKNOWN = (96, 96, 96)
BAR_PX, TEXT_PX = 14, 74


def colour_depth(
    depth: Field, nearest: float | None = None, farthest: float | None = None
) -> NDArray[np.uint8]:
    """Near is red, far is blue, evenly in 1/Z; unknown is grey; the bar at the right is labelled in metres.

    Args:
        depth: Z in metres, height × width, NaN where unknown.
        nearest, farthest: ends of the scale, m; the 1st and 99th percentile by default.

    Returns:
        height × (width + bar) × 3, BGR.
    """
    height = depth.shape[0]
    with np.errstate(divide="ignore", invalid="ignore"):
        inverse = np.where(np.isfinite(depth) & (depth > 0), 1 / depth, np.nan)
    known = np.isfinite(inverse)
    low, high = (float(v) for v in np.percentile(inverse[known], (1, 99))) if known.any() else (0.5, 1.0)
    low = low if farthest is None else 1 / farthest
    high = max(high if nearest is None else 1 / nearest, low * 1.001 + 1e-9)
    shade = np.clip((np.nan_to_num(inverse) - low) / (high - low) * 255, 0, 255).astype(np.uint8)
    picture = cv2.applyColorMap(shade, cv2.COLORMAP_TURBO)
    picture[~known] = UNKNOWN
    scale = np.full((height, BAR_PX + TEXT_PX, 3), 255, np.uint8)
    ramp = np.linspace(255, 0, max(height - 20, 2)).astype(np.uint8)[:, None].repeat(BAR_PX - 4, axis=1)
    scale[10 : 10 + len(ramp), 4:BAR_PX] = cv2.applyColorMap(ramp, cv2.COLORMAP_TURBO)
    for part in np.linspace(0, 1, 5):
        inverse_here = high + (low - high) * part
        label = f"{1 / inverse_here:.3g} m" if inverse_here > 1e-6 else "inf"
        row = 14 + int(part * (len(ramp) - 1))
        cv2.putText(
            scale, label, (BAR_PX + 4, row), cv2.FONT_HERSHEY_SIMPLEX, 0.36, (0, 0, 0), 1, cv2.LINE_AA
        )
    return np.hstack([picture, scale]).astype(np.uint8)
