"""What is true of every pixel of a picture: the channels there are, and one picture's worth of them.

Values hold at pixels' centres, for the first opaque surface there. Where there is none: NaN, False or 0.
"""

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
