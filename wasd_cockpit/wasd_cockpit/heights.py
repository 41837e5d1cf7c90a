# SPDX-License-Identifier: Apache-2.0
"""Colours of heights, and their scale."""

import numpy as np

# Colours of heights from the lowest to the highest, of equal steps in brightness (viridis, whose
# darkest is left out: it could not be told from what is unknown).
HEIGHTS = (
    (70, 50, 127),
    (54, 92, 141),
    (39, 127, 142),
    (31, 161, 135),
    (74, 194, 109),
    (253, 231, 37),
)
# The scale ends at multiples of this height [m], which lie at least so far apart [m].
SCALE_STEP, LEAST_SPAN = 0.1, 0.2
# This share of the known cells is below, and above, the scale: few wrong ones do not stretch it.
BEYOND = 0.01


def height_scale(heights: np.ndarray) -> tuple[float, float]:
    """Return the ends of the scale of colours for heights [m], NaN where unknown."""
    known = heights[np.isfinite(heights)]
    if not len(known):
        return 0.0, LEAST_SPAN
    low, high = np.quantile(known, (BEYOND, 1.0 - BEYOND)).tolist()
    # A floor that is known to the millimetre is not to change the scale all the time.
    first = np.floor(low / SCALE_STEP + 0.3)
    last = max(np.ceil(high / SCALE_STEP - 0.3), first + round(LEAST_SPAN / SCALE_STEP))
    return float(first * SCALE_STEP), float(last * SCALE_STEP)


def height_colours(heights: np.ndarray, low: float, high: float) -> np.ndarray:
    """Return colours (..., 3) of heights [m] on a scale; of NaN, the lowest."""
    share = np.clip((np.nan_to_num(heights, nan=low) - low) / (high - low), 0.0, 1.0)
    ends = np.linspace(0.0, 1.0, len(HEIGHTS))
    channels = [np.interp(share, ends, channel) for channel in np.transpose(HEIGHTS)]
    return np.stack(channels, axis=-1).astype(np.uint8)


def paint_heights(heights: np.ndarray, low: float, high: float) -> bytes:
    """Return the picture of heights (rows, columns) [m], y up: rgba bytes; NaN is left out."""
    image = np.zeros((*heights.shape, 4), dtype=np.uint8)
    image[..., :3] = height_colours(heights[::-1], low, high)
    image[..., 3] = 255 * np.isfinite(heights[::-1])
    return image.tobytes()
