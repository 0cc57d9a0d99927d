"""Truth channels as pictures for people: colours that tell values apart."""

import numpy as np
from numpy.typing import NDArray

Picture = NDArray[np.uint8]
Shares = NDArray[np.float64]

# Near to far: light to dark, and told apart by the colour-blind.
NEAR_TO_FAR = np.array([[255, 245, 160], [250, 160, 60], [200, 50, 100], [90, 20, 130], [20, 10, 60]], float)
GOLDEN = 0.618034  # steps around the colour wheel by it never come close to an earlier one soon
MOST_FLOW = 99.0  # per cent of pixels that are not too fast for the scale


def picture(channel: str, values: NDArray[np.generic]) -> Picture:
    """A channel of a TruthFrame (H, W, ...) as red, green and blue (H, W, 3); black where nothing is known.

    Distances on a logarithmic scale; normals (right, down, ahead) as colours around grey; flow's direction
    as hue and length as strength; ids as colours of their own; masks white, shadows the lighter the more.
    """
    if channel == "depth":
        return _depth(values.astype(np.float64))
    if channel == "normals":
        return _known(127.5 * (1 - values.astype(np.float64)))
    if channel == "flow":
        return _flow(values.astype(np.float64))
    if channel in {"instance", "material"}:
        return _ids(values.astype(np.int64))
    share = values.astype(np.float64) / max(1, int(values.astype(np.int64).max(initial=0)))
    return np.repeat(_known(255 * share)[..., None], 3, -1)


def _depth(depth_m: NDArray[np.float64]) -> Picture:
    known = depth_m[np.isfinite(depth_m) & (depth_m > 0)]
    if not len(known):
        return np.zeros((*depth_m.shape, 3), np.uint8)
    low, high = np.log(known.min()), np.log(known.max())
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (np.log(depth_m) - low) / max(high - low, 1e-9) * (len(NEAR_TO_FAR) - 1)
    steps = np.arange(len(NEAR_TO_FAR))
    return _known(np.stack([np.interp(share, steps, part) for part in NEAR_TO_FAR.T], -1))


def _flow(flow_px: NDArray[np.float64]) -> Picture:
    speed_px = np.linalg.norm(flow_px, axis=-1)
    known = np.isfinite(speed_px)
    scale_px = max(float(np.percentile(speed_px[known], MOST_FLOW)), 1e-6) if known.any() else 1.0
    turn: Shares = np.arctan2(flow_px[..., 1], flow_px[..., 0]) / (2 * np.pi)
    return _known(255 * _wheel(turn, np.minimum(speed_px / scale_px, 1)))


def _ids(ids: NDArray[np.int64]) -> Picture:
    numbers = ids.astype(np.float64)
    colors = _known(255 * _wheel(GOLDEN * numbers, 0.45 + 0.3 * (numbers % 2)))
    colors[ids == 0] = 0
    return colors


def _wheel(turn: Shares, strength: Shares) -> Shares:
    """Colours (..., 3) in [0, 1] at places on the colour wheel, in turns; white at strength 0."""
    distance = np.abs((turn[..., None] - np.array([0, 1 / 3, 2 / 3]) + 0.5) % 1 - 0.5)  # to red, green and blue
    return np.asarray(1 - strength[..., None] * (1 - np.clip(2 - 6 * distance, 0, 1)))


def _known(values: NDArray[np.float64]) -> Picture:
    """Whole numbers from 0 to 255, 0 for NaN."""
    return np.rint(np.clip(np.nan_to_num(values), 0, 255)).astype(np.uint8)
