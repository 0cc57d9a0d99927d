"""The path tracer: pictures by Mitsuba, with everything that light does; slow, and the judge of the raster engine."""

import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from vobench import stop
from vobench.errors import RenderError
from vobench.geometry.camera import Camera
from vobench.geometry.se3 import Array
from vobench.render import llvm
from vobench.render.mitsuba_scene import MitsubaScene, State, state
from vobench.render.renderer import Radiance, View
from vobench.scene.scene import Scene

SAMPLES = 64  # paths a pixel where nobody says how many
MAX_LANES = 1 << 22  # paths traced at once; more cost memory and are no faster


@dataclass(frozen=True, slots=True)
class Batch:
    """Rows of the picture that see one state of the scene, each from a pose of its own; one light path per sample.

    rows (R,), start_ns (R,), T_world_camera (R, 4, 4), weight (R,): the share in the row's whole exposure.
    """

    rows: NDArray[np.int64]
    start_ns: NDArray[np.int64]
    T_world_camera: Array
    weight: Array


class PathRenderer:
    """Pictures of a scene by path tracing, `samples` paths a pixel, each up to max_depth segments long.

    max_depth 2 is direct light, None ends paths by Russian roulette alone. The noise is a function of seed, time
    and pose: the same picture has the same bytes, and no two pictures share their noise.
    """

    def __init__(self, scene: Scene, *, samples: int = SAMPLES, seed: int = 0, max_depth: int | None = 16) -> None:
        _check(samples, max_depth)
        llvm.prepare()
        self._scene, self._samples, self._seed = scene, samples, seed
        self._mitsuba = MitsubaScene(scene, max_depth=max_depth)
        self._lens: tuple[Camera, Radiance] | None = None

    def radiance(self, camera: Camera, views: Sequence[View]) -> Radiance:
        """Luminance (H, W) in cd/m², linear and unclipped, averaged over each pixel's area; views tile the rows.

        A pixel one of whose corners the lens does not see is black.
        """
        picture = np.zeros((camera.height_px, camera.width_px), np.float32)
        for (moment, samples), batch in _batches(self._scene, views, self._samples):
            self._mitsuba.become(moment)
            light = self._trace(camera, batch, samples)
            np.add.at(picture, batch.rows, light * batch.weight[:, None].astype(np.float32))
        return picture

    def close(self) -> None:
        """Give back Mitsuba's copy of the scene."""
        del self._mitsuba
        self._lens = None

    def _trace(self, camera: Camera, batch: Batch, samples: int) -> Radiance:
        """Mean radiance (R, W) of the rows of a batch over `samples` paths a pixel, some at a time."""
        at_once = max(1, min(samples, MAX_LANES // (len(batch.rows) * camera.width_px)))
        counts = [at_once] * (samples // at_once) + [samples % at_once] * (samples % at_once > 0)
        rays = self._corner_rays(camera)
        total = np.zeros((len(batch.rows), camera.width_px), np.float32)
        for seed, count in zip(_seeds(self._seed, batch, len(counts)), counts, strict=True):
            stop.check()
            total += self._mitsuba.trace(rays, batch.rows, batch.T_world_camera, count, seed)
        return total / np.float32(samples)

    def _corner_rays(self, camera: Camera) -> Radiance:
        """Directions (H + 1, W + 1, 3) float32 through the corners of the pixels, kept from picture to picture."""
        if self._lens is None or self._lens[0] != camera:
            u, v = np.meshgrid(np.arange(camera.width_px + 1) - 0.5, np.arange(camera.height_px + 1) - 0.5)
            self._lens = camera, camera.rays(np.stack([u, v], -1)).astype(np.float32)
        return self._lens[1]


def _check(samples: int, max_depth: int | None) -> None:
    if samples < 1:
        raise RenderError(f"cannot trace {samples} paths a pixel; samples must be 1 or more")
    if max_depth is not None and max_depth < 1:
        raise RenderError(f"cannot trace paths of {max_depth} segments; max_depth must be 1 or more, or None")


def _batches(scene: Scene, views: Sequence[View], samples: int) -> Iterator[tuple[tuple[State, int], Batch]]:
    """All rows at all their moments, gathered by the scene's state and by the paths a pixel has at that moment.

    A row exposed in M moments has its samples spread evenly over them, at least one for each.
    """
    gathered: dict[tuple[State, int], list[tuple[View, int]]] = {}
    for view in views:
        moments = len(view.start_ns)
        for m in range(moments):
            key = state(scene, int(view.start_ns[m]), int(view.end_ns[m])), -(-samples // moments)
            gathered.setdefault(key, []).append((view, m))
    for key, members in gathered.items():
        yield key, _gather(members)


def _gather(members: list[tuple[View, int]]) -> Batch:
    """The rows of views, each in one of its moments, one after another."""
    rows = [np.arange(view.rows.start, view.rows.stop) for view, _ in members]
    lengths = [len(r) for r in rows]
    return Batch(
        np.concatenate(rows),
        np.repeat([view.start_ns[m] for view, m in members], lengths),
        np.repeat([view.T_world_camera[m] for view, m in members], lengths, axis=0),
        np.repeat([1 / len(view.start_ns) for view, _ in members], lengths),
    )


def _seeds(seed: int, batch: Batch, count: int) -> list[int]:
    """Seeds that differ between pictures from other places or times."""
    moment = batch.rows, batch.start_ns, batch.T_world_camera
    words = [zlib.crc32(np.ascontiguousarray(part).tobytes()) for part in moment]
    return [int(word) for word in np.random.SeedSequence([seed, *words]).generate_state(count)]
