"""The path tracer: pictures by Mitsuba, the reference of the raster engine."""

import zlib
from collections.abc import Iterator, Sequence
from copy import copy
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.rendering import mitsuba
from vobench.rendering.mitsuba_scene import MitsubaScene, SceneState, scene_state
from vobench.rendering.renderer import Radiance, View
from vobench.scene.material import LUMINANCE
from vobench.scene.scene import Scene

SAMPLES = 64  # paths per pixel, by default
MAX_LANES = 1 << 22  # paths that are traced at once; more need memory and are no faster


@dataclass(frozen=True, slots=True)
class RowBatch:
    """Rows (R,) of a picture that show one state of the scene.

    start_ns (R,) and T_world_camera (R, 4, 4): when and from where each is exposed. weight (R,): the share of this
    moment in the exposure of the row.
    """

    rows: NDArray[np.int64]
    start_ns: NDArray[np.int64]
    T_world_camera: Array
    weight: Array


class PathRenderer:
    """Renders pictures of a scene by path tracing.

    samples: the number of paths per pixel. max_depth: the number of segments of a path at most; 2 is direct light
    only, with None paths end by Russian roulette alone. The noise is a function of seed, time and pose: the same
    picture has the same bytes, and no two pictures share their noise.

    Raises RenderError if samples or max_depth is less than 1, and MissingDependencyError without Mitsuba.
    """

    def __init__(
        self,
        scene: Scene,
        *,
        samples: int = SAMPLES,
        seed: int = 0,
        max_depth: int | None = 16,
    ) -> None:
        if samples < 1:
            raise RenderError(f"cannot trace {samples} paths a pixel; samples must be 1 or more")
        if max_depth is not None and max_depth < 1:
            raise RenderError(f"cannot trace paths of {max_depth} segments; max_depth must be 1 or more, or None")
        mitsuba.prepare()
        self._scene = scene
        self._samples = samples
        self._seed = seed
        self._mitsuba = MitsubaScene(scene, max_depth=max_depth)

    def radiance(
        self,
        camera: Camera,
        views: Sequence[View],
        *,
        weights: ArrayLike | None = LUMINANCE,
    ) -> Radiance:
        """Luminance (H, W) in cd/m² of weighted channels, or (H, W, 3) without weights; see `Renderer`.

        A pixel is black if the lens does not see all of its corners.
        """
        picture = np.zeros((camera.height_px, camera.width_px, 3), np.float32)
        for (wanted, samples), batch in _batches(self._scene, views, self._samples):
            self._mitsuba.become(wanted)
            radiance = self._trace(camera, batch, samples)
            row_weight = batch.weight[:, None, None].astype(np.float32)
            np.add.at(picture, batch.rows, radiance * row_weight)
        if weights is None:
            return picture
        return np.asarray(picture @ np.asarray(weights, np.float32))

    def with_seed(self, seed: int) -> "PathRenderer":
        """The same renderer with other noise. Both share one copy of the scene in Mitsuba.

        OptiX, which the variant for GPUs uses, refuses two copies in one process.
        """
        other = copy(self)
        other._seed = seed
        return other

    def close(self) -> None:
        """Free the copy of the scene in Mitsuba."""
        del self._mitsuba

    def _trace(self, camera: Camera, batch: RowBatch, samples: int) -> Radiance:
        """The mean radiance (R, W, 3) of the rows of a batch over `samples` paths per pixel, traced in parts."""
        pixel_count = len(batch.rows) * camera.width_px
        most_at_once = max(1, min(samples, MAX_LANES // pixel_count))
        counts = [most_at_once] * (samples // most_at_once)
        if samples % most_at_once:
            counts.append(samples % most_at_once)
        rays = _corner_rays(camera)
        total = np.zeros((len(batch.rows), camera.width_px, 3), np.float32)
        for seed, count in zip(_seeds(self._seed, batch, len(counts)), counts, strict=True):
            stop.check()
            total += self._mitsuba.trace(rays, batch.rows, batch.T_world_camera, count, seed)
        return total / np.float32(samples)


@lru_cache(maxsize=1)
def _corner_rays(camera: Camera) -> Radiance:
    """The directions (H + 1, W + 1, 3) float32 through the corners of pixels, cached from picture to picture."""
    columns_px = np.arange(camera.width_px + 1) - 0.5
    rows_px = np.arange(camera.height_px + 1) - 0.5
    u, v = np.meshgrid(columns_px, rows_px)
    return camera.rays(np.stack([u, v], -1)).astype(np.float32)


def _batches(
    scene: Scene,
    views: Sequence[View],
    samples: int,
) -> Iterator[tuple[tuple[SceneState, int], RowBatch]]:
    """All rows of views at all moments of their exposure, grouped by the state of the scene and the paths per pixel.

    The paths of a row that is exposed in M moments are divided evenly between them, at least one for each.
    """
    members_by_key: dict[tuple[SceneState, int], list[tuple[View, int]]] = {}
    for view in views:
        moment_count = len(view.start_ns)
        samples_each = -(-samples // moment_count)
        for moment in range(moment_count):
            state = scene_state(scene, int(view.start_ns[moment]), int(view.end_ns[moment]))
            members_by_key.setdefault((state, samples_each), []).append((view, moment))
    for key, members in members_by_key.items():
        yield key, _row_batch(members)


def _row_batch(members: Sequence[tuple[View, int]]) -> RowBatch:
    """The rows of views, each at one of its moments."""
    rows = [np.arange(view.rows.start, view.rows.stop) for view, _ in members]
    counts = [len(view_rows) for view_rows in rows]
    start_ns = [view.start_ns[moment] for view, moment in members]
    T_world_camera = [view.T_world_camera[moment] for view, moment in members]
    weights = [1 / len(view.start_ns) for view, _ in members]
    return RowBatch(
        np.concatenate(rows),
        np.repeat(start_ns, counts),
        np.repeat(T_world_camera, counts, axis=0),
        np.repeat(weights, counts),
    )


def _seeds(seed: int, batch: RowBatch, count: int) -> list[int]:
    """Seeds that differ between pictures from other poses or times."""
    arrays = (batch.rows, batch.start_ns, batch.T_world_camera)
    checksums = [zlib.crc32(np.ascontiguousarray(array).tobytes()) for array in arrays]
    sequence = np.random.SeedSequence([seed, *checksums])
    return [int(word) for word in sequence.generate_state(count)]
