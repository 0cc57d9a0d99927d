"""Ground truth of every pixel: its channels, and pictures of them."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench.errors import UnknownNameError

Floats = NDArray[np.float32]
Mask = NDArray[np.bool_]
Ids = NDArray[np.uint16]


@dataclass(frozen=True, slots=True)
class Channel:
    """Values of one kind: their type, and how many a pixel has."""

    dtype: type[np.generic]
    depth: int = 1

    def shape(self, height_px: int, width_px: int) -> tuple[int, ...]:
        """Of the array that holds a picture's values: (H, W) or (H, W, depth)."""
        return (height_px, width_px) if self.depth == 1 else (height_px, width_px, self.depth)


CHANNELS = {
    "depth": Channel(np.float32),
    "normals": Channel(np.float32, 3),
    "flow": Channel(np.float32, 2),
    "occlusion": Channel(np.bool_),
    "instance": Channel(np.uint16),
    "material": Channel(np.uint16),
    "mirror": Channel(np.bool_),
    "shadow": Channel(np.uint16),
    "moving": Channel(np.bool_),
}


@dataclass(frozen=True, slots=True)
class TruthFrame:
    """One picture's truth; None for a channel that was not asked for.

    depth (H, W) metres along the optical axis, along the ray for a camera that sees all around;
    normals (H, W, 3) unit, in the camera's frame; flow (H, W, 2) pixels to where the point is in the next
    picture; occlusion: it is hidden or outside there; instance, material: places in TruthNames;
    mirror: mirrors, coats and panes; shadow: how many lights are hidden; moving: on a mover.
    """

    depth: Floats | None = None
    normals: Floats | None = None
    flow: Floats | None = None
    occlusion: Mask | None = None
    instance: Ids | None = None
    material: Ids | None = None
    mirror: Mask | None = None
    shadow: Ids | None = None
    moving: Mask | None = None

    def channels(self) -> dict[str, NDArray[np.generic]]:
        """The channels that are there, by name and in the order of CHANNELS."""
        held = {name: getattr(self, name) for name in CHANNELS}
        return {name: values for name, values in held.items() if values is not None}


@dataclass(frozen=True, slots=True)
class TruthNames:
    """What the numbers of the channels `instance` and `material` mean: places here; 0 is nothing named."""

    instance: tuple[str, ...] = ("",)
    material: tuple[str, ...] = ("",)


def check_channels(names: Iterable[str]) -> tuple[str, ...]:
    """The channels in their own order, each once. Raises UnknownNameError for one that does not exist."""
    asked = set(names)
    for name in sorted(asked):
        if name not in CHANNELS:
            raise UnknownNameError(f"no truth channel '{name}'. Known: {', '.join(CHANNELS)}")
    return tuple(name for name in CHANNELS if name in asked)


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
    low = np.log(known.min())
    high = np.log(known.max())
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
