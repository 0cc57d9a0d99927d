"""Per-pixel ground truth: its channels, and pictures of them."""

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
    """A kind of per-pixel ground truth: the type of its values, and how many a pixel has."""

    dtype: type[np.generic]
    depth: int = 1

    def shape(self, height_px: int, width_px: int) -> tuple[int, ...]:
        """The shape of the array of a picture's values: (H, W) or (H, W, depth)."""
        if self.depth == 1:
            return (height_px, width_px)
        return (height_px, width_px, self.depth)


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
    """The ground truth of one picture; None for a channel that was not asked for.

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
        """The channels that are not None, by name and in the order of CHANNELS."""
        channels = {name: getattr(self, name) for name in CHANNELS}
        return {name: values for name, values in channels.items() if values is not None}


@dataclass(frozen=True, slots=True)
class TruthNames:
    """The names of the ids in the channels `instance` and `material`, which are indices here; 0 has no name."""

    instance: tuple[str, ...] = ("",)
    material: tuple[str, ...] = ("",)


def check_channels(names: Iterable[str]) -> tuple[str, ...]:
    """The channels in the order of CHANNELS, each once. Raises UnknownNameError for one that does not exist."""
    requested = set(names)
    for name in sorted(requested):
        if name not in CHANNELS:
            raise UnknownNameError(f"no truth channel '{name}'. Known: {', '.join(CHANNELS)}")
    return tuple(name for name in CHANNELS if name in requested)


Picture = NDArray[np.uint8]
Shares = NDArray[np.float64]

# From light to dark, and distinguishable for the colour-blind.
NEAR_TO_FAR = np.array([[255, 245, 160], [250, 160, 60], [200, 50, 100], [90, 20, 130], [20, 10, 60]], float)
GOLDEN = 0.618034  # steps of it around the colour wheel stay away from earlier ones for long
FLOW_PERCENTILE = 99.0  # of the speeds, whose value has full strength


def picture(channel: str, values: NDArray[np.generic]) -> Picture:
    """A channel of a TruthFrame (H, W, ...) as red, green and blue (H, W, 3); black where the value is unknown.

    Distances on a logarithmic scale; normals (right, down, ahead) as colours around grey; flow's direction
    as hue and length as strength; ids as distinct colours; masks white, shadows the lighter the more.
    """
    if channel == "depth":
        return _depth(values.astype(np.float64))
    if channel == "normals":
        return _rounded(127.5 * (1 - values.astype(np.float64)))
    if channel == "flow":
        return _flow(values.astype(np.float64))
    if channel in {"instance", "material"}:
        return _ids(values.astype(np.int64))
    largest = int(values.astype(np.int64).max(initial=0))
    share = values.astype(np.float64) / max(1, largest)
    grey = _rounded(255 * share)
    return np.repeat(grey[..., None], 3, -1)


def _depth(depth_m: NDArray[np.float64]) -> Picture:
    is_known = np.isfinite(depth_m) & (depth_m > 0)
    known_m = depth_m[is_known]
    if not len(known_m):
        return np.zeros((*depth_m.shape, 3), np.uint8)
    nearest = np.log(known_m.min())
    farthest = np.log(known_m.max())
    last = len(NEAR_TO_FAR) - 1
    with np.errstate(invalid="ignore", divide="ignore"):
        share = (np.log(depth_m) - nearest) / max(farthest - nearest, 1e-9)
    place = share * last  # in the colour map
    places = np.arange(last + 1)
    channels = [np.interp(place, places, channel) for channel in NEAR_TO_FAR.T]
    return _rounded(np.stack(channels, -1))


def _flow(flow_px: NDArray[np.float64]) -> Picture:
    speed_px = np.linalg.norm(flow_px, axis=-1)
    is_known = np.isfinite(speed_px)
    full_px = 1.0
    if is_known.any():
        full_px = max(float(np.percentile(speed_px[is_known], FLOW_PERCENTILE)), 1e-6)
    right_px = flow_px[..., 0]
    down_px = flow_px[..., 1]
    direction: Shares = np.arctan2(down_px, right_px) / (2 * np.pi)  # in turns
    strength = np.minimum(speed_px / full_px, 1)
    return _rounded(255 * _wheel(direction, strength))


def _ids(ids: NDArray[np.int64]) -> Picture:
    numbers = ids.astype(np.float64)
    strength = 0.45 + 0.3 * (numbers % 2)
    colours = _rounded(255 * _wheel(GOLDEN * numbers, strength))
    colours[ids == 0] = 0
    return colours


def _wheel(hue: Shares, strength: Shares) -> Shares:
    """Colours (..., 3) in [0, 1] at hues on the colour wheel, in turns; white at strength 0."""
    primaries = np.array([0, 1 / 3, 2 / 3])  # red, green and blue
    distance = np.abs((hue[..., None] - primaries + 0.5) % 1 - 0.5)  # in turns
    saturated = np.clip(2 - 6 * distance, 0, 1)
    return np.asarray(1 - strength[..., None] * (1 - saturated))


def _rounded(values: NDArray[np.float64]) -> Picture:
    """Whole numbers from 0 to 255, 0 for NaN."""
    clipped = np.clip(np.nan_to_num(values), 0, 255)
    return np.rint(clipped).astype(np.uint8)
