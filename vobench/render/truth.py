"""Exact ground truth of a picture: rays through its pixels' centres, for any camera, rolling shutter and movers.

Light plays no part but in `shadow`. Glass is looked through: every channel speaks of the first opaque
surface, and only `mirror` of the pane before it. Back sides are not seen.
"""

import os
from collections.abc import Iterable, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import numpy as np
from numpy.typing import NDArray

from vobench.geometry.camera import Camera
from vobench.render.beams import TILE_PX
from vobench.render.bodies import Bodies
from vobench.render.shadow import lamps
from vobench.render.stand import Shot, stand
from vobench.render.truth_band import Band, Looks
from vobench.render.truth_plan import plan
from vobench.scene.material import Matt, Mirror, Polished
from vobench.scene.scene import Scene
from vobench.sensor.truth import CHANNELS, TruthFrame, TruthNames, check_channels

__all__ = ["Shot", "TruthCaster"]

BAND_ROWS = 3 * TILE_PX  # worked on at a time: their arrays stay in the processor's cache
THREADS = max(1, min(2, os.cpu_count() or 1))


class TruthCaster:
    """Ground truth of one scene; `names` says what its ids mean."""

    def __init__(self, scene: Scene) -> None:
        self._scene, self._bodies = scene, Bodies(scene)
        surfaces = self._bodies.surfaces
        things = ["", *(mover.name for mover in scene.movers)]
        instances = [things[b] or s.instance for b, s in zip(self._bodies.of_surface, surfaces, strict=True)]
        materials = [s.material for s in surfaces]
        self.names = TruthNames(_table(instances), _table(materials))
        kinds = [*(scene.materials.get(name) for name in materials), None]
        self._looks = Looks(
            _ids(instances, self.names.instance),
            _ids(materials, self.names.material),
            np.array([isinstance(kind, Mirror | Polished) for kind in kinds]),
            np.array([isinstance(kind, Matt | Polished) for kind in kinds]),
        )
        self._pool = ThreadPoolExecutor(THREADS)

    def frame(
        self, camera: Camera, now: Shot, channels: Iterable[str] = tuple(CHANNELS), *, later: Shot | None = None
    ) -> TruthFrame:
        """The channels asked for; `later` is the next picture, without which flow is NaN and all is occluded.

        Raises UnknownNameError for a channel that does not exist.
        """
        height, width = camera.height_px, camera.width_px
        wanted = {name: CHANNELS[name] for name in check_channels(channels)}
        values: dict[str, Any] = {name: np.empty(c.shape(height, width), c.dtype) for name, c in wanted.items()}
        lit = lamps(self._scene, int(np.mean(now.t_ns))) if "shadow" in wanted else ()
        there = stand(self._bodies, later) if later else None
        whole = plan(self._bodies, camera, stand(self._bodies, now), there, lit)

        def fill(rows: slice) -> None:
            for name, found in Band(whole, self._looks, rows).values(tuple(wanted)).items():
                values[name][rows] = found.reshape(values[name][rows].shape)

        starts = range(0, height, BAND_ROWS)
        list(self._pool.map(fill, [slice(row, min(row + BAND_ROWS, height)) for row in starts]))
        return TruthFrame(**values)


def _table(names: Iterable[str]) -> tuple[str, ...]:
    """Nothing, then each name once, in order."""
    return tuple(dict.fromkeys(["", *names]))


def _ids(names: Sequence[str], table: Sequence[str]) -> NDArray[np.uint16]:
    """The names' places in a table (S + 1,); the last one is nothing, for the surface -1."""
    return np.array([*(table.index(name) for name in names), 0], np.uint16)
