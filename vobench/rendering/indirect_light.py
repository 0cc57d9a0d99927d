"""Indirect light: rays gather light from surfels, lamps and the sky, and photons bring light to surfels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench.rendering.array_types import Floats, Indices, Mask, Rows
from vobench.rendering.atlas import Atlas
from vobench.rendering.face_response import Response
from vobench.rendering.geometry import FAR_M
from vobench.rendering.ray_batch import RayBatch, RayEnds, joined_ends
from vobench.rendering.ray_kernels import sorted_by_point
from vobench.rendering.specular_path import SpecularTracer, hemisphere_rays
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import in_chunks
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sky

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

TURN = np.array([0.4142135624, 0.7320508076], np.float32)  # the step of the random numbers from one turn to the next
MIRRORS = 4  # the largest number of reflections of a ray
POINTS = 1 << 9  # the number of points whose rays are traced at a time
MOST_RAYS = 25_000_000  # the largest number of rays in a table
PHOTONS = 1 << 16  # the number of photons that are traced at a time


@dataclass(frozen=True, slots=True)
class FinalGather:
    """The result of rays from P points.

    The illuminance of the points is the product of `table` (P, S + L) with the radiosity of the S surfels and L lamps,
    plus `sky` (K, P), the light of each of K skies by mirrors.
    `hits` (H·W,) is the number of rays that ended on each texel.
    `escaped` (P,) is the share of rays that left the scene, except through panes that show the sky.
    """

    table: "csr_matrix"
    sky: Floats
    hits: Rows
    escaped: Floats


@dataclass(frozen=True, slots=True)
class Sample:
    """The result of some of the rays from P points.

    `near` and `far` (P, S + L) are tables as in `FinalGather`: of the rays whose last segment is shorter than NEAR_M,
    and of the other rays. `sky` (K, P) and `escaped` (P,) are as there.
    `texels` (R,) are the texels on which rays ended.
    """

    near: "csr_matrix"
    far: "csr_matrix"
    sky: Floats
    escaped: Floats
    texels: Indices


@dataclass(frozen=True, slots=True)
class Photons:
    """R photons that leave reflecting faces.

    `origins_m` and `directions` (R, 3) are in the world, `flux_lm` (R,) is the flux of each photon in lumens.
    `is_shown` (R,) is whether the first face that it meets already shows its light, as the image of a lamp in a mirror.
    `dither` (R, 2) are random numbers.
    """

    origins_m: Floats
    directions: Floats
    flux_lm: Floats
    is_shown: Mask
    dither: Floats


@dataclass(frozen=True, slots=True)
class Gatherer:
    """Casts rays from points, and records where they end.

    `surfel_of` (H·W,) is the surfel of each texel, -1 for none.
    `surfels` and `lamps` are their numbers, S and L.
    """

    atlas: Atlas
    visibility: Visibility
    response: Response
    skies: Sequence[Sky]
    surfel_of: Indices
    surfels: int
    lamps: int
    _tracer: SpecularTracer = field(init=False, repr=False)

    def __post_init__(self) -> None:
        tracer = SpecularTracer(
            self.atlas,
            self.visibility,
            self.response,
            self.surfel_of,
            lamp_column=self.surfels if self.lamps else -1,
        )
        object.__setattr__(self, "_tracer", tracer)

    def gather(
        self,
        points: Texels,
        *,
        rays: int,
        done: Callable[[float], object] | None = None,
    ) -> FinalGather:
        """Cast about `rays` rays from every point. `done` is called with the share of the work that is done."""
        rays_each = min(rays, MOST_RAYS / max(len(points), 1))
        sample = self.sample(points, side=int(np.sqrt(rays_each)), done=done)
        return FinalGather(sample.near + sample.far, sample.sky, self.hits(sample), sample.escaped)

    def hits(self, sample: Sample) -> Rows:
        """The number of rays of a sample that ended on each texel of the map (H·W,)."""
        return np.bincount(sample.texels, minlength=self.atlas.height * self.atlas.width)

    def sample(
        self,
        points: Texels,
        *,
        side: int,
        turn: int = 0,
        done: Callable[[float], object] | None = None,
    ) -> Sample:
        """Cast side x side rays from every point, in other directions in each turn.

        `done` is called with the share of the work that is done.
        """
        if not side or not len(points):
            return self._empty_sample(len(points))
        points = turned(points, turn)

        def sample_of(part: slice) -> Sample:
            return self._sample(points.take(part), side)

        parts = in_chunks(sample_of, len(points), chunk=POINTS, done=done)
        return Sample(
            near=scipy.sparse.vstack([part.near for part in parts], "csr"),
            far=scipy.sparse.vstack([part.far for part in parts], "csr"),
            sky=np.concatenate([part.sky for part in parts], 1),
            escaped=np.concatenate([part.escaped for part in parts]),
            texels=np.concatenate([part.texels for part in parts]),
        )

    def _empty_sample(self, point_count: int) -> Sample:
        """The result for points without rays, from which all light counts as escaped."""
        no_entries = scipy.sparse.csr_matrix((point_count, self.surfels + self.lamps), dtype=np.float32)
        return Sample(
            near=no_entries,
            far=no_entries,
            sky=np.zeros((len(self.skies), point_count), np.float32),
            escaped=np.ones(point_count, np.float32),
            texels=np.zeros(0, np.int32),
        )

    def light(
        self,
        points: Texels,
        radiosity: Floats,
        *,
        side: int,
        turn: int,
    ) -> tuple[Floats, Floats, Floats]:
        """The light that side x side rays from every point find: near and far (P, C), and the skies by mirrors (K, P).

        `radiosity` (S, C) is that of surfels in C channels.
        """
        points = turned(points, turn)

        def light_of(part: slice) -> tuple[Floats, Floats, Floats]:
            sample = self._sample(points.take(part), side)
            return sample.near @ radiosity, sample.far @ radiosity, sample.sky

        parts = in_chunks(light_of, len(points), chunk=POINTS)
        near, far, sky = zip(*parts, strict=True)
        return np.concatenate(near), np.concatenate(far), np.concatenate(sky, 1)

    def deposited(self, photons: Photons) -> Floats:
        """The flux (S,) in lumens that photons bring to surfels. Under a coat it is the flux that enters the coat."""
        flux_lm = np.zeros(self.surfels)

        def trace(part: slice) -> Floats:
            return self._deposited(photons, np.arange(len(photons.flux_lm), dtype=np.int32)[part])

        for part_lm in in_chunks(trace, len(photons.flux_lm), chunk=PHOTONS):
            flux_lm += part_lm
        return flux_lm

    def _sample(self, points: Texels, side: int) -> Sample:
        """The result of side x side rays from every point."""
        ray_count = np.float32(side * side)
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        escaped = np.zeros(len(points), np.float32)
        batch = hemisphere_rays(points, side)
        parts = []
        for depth in range(MIRRORS + 1):
            followed = self._tracer.follow(batch, points.dither, is_first=depth == 0)
            parts.append(followed.ends)
            if depth == 0:
                escaped += self._escaped_counts(followed.escaped, len(points)) / ray_count
            else:
                self._add_sky(sky, followed.escaped)
            batch = followed.onward
            if not len(batch.point):
                break
        ends = joined_ends(parts)
        ends.share[:] /= ray_count
        return Sample(
            near=self._table(ends, ends.is_near, len(points)),
            far=self._table(ends, ~ends.is_near, len(points)),
            sky=sky / ray_count,
            escaped=escaped,
            texels=ends.texel,
        )

    def _deposited(self, photons: Photons, rows: Indices) -> Floats:
        """The flux (S,) in lumens that the photons at rows (N,) bring to surfels."""
        flux_lm = np.zeros(self.surfels)
        batch = RayBatch(
            point=rows,
            origins_m=photons.origins_m[rows],
            directions=photons.directions[rows],
            weight=np.ones(len(rows), np.float32),
            is_direct=photons.is_shown[rows],
        )
        # The first face of the shown photons shows their light already. Only the light that it reflects counts.
        shown = batch.take(batch.is_direct)
        batch = batch.take(~batch.is_direct)
        from_shown = self._tracer.follow(shown, photons.dither, is_first=False).onward
        for depth in range(MIRRORS):
            followed = self._tracer.follow(batch, photons.dither, is_first=False)
            batch = followed.onward.joined(from_shown) if depth == 0 else followed.onward
            ends = followed.ends
            is_surfel = ends.column < self.surfels
            arriving_lm = ends.share[is_surfel] * photons.flux_lm[ends.point[is_surfel]]
            flux_lm += np.bincount(ends.column[is_surfel], arriving_lm, self.surfels)
            if not len(batch.point):
                break
        return flux_lm

    def _table(self, ends: RayEnds, selected: Mask, point_count: int) -> "csr_matrix":
        """The table (P, S + L) of the ends of the selected rays (R,), with an entry for each ray."""
        count = np.count_nonzero(selected)
        starts = np.empty(point_count + 1, np.int32)
        columns = np.empty(count, np.int32)
        shares = np.empty(count, np.float32)
        sorted_by_point(ends.point, ends.column, ends.share, selected, starts, columns, shares)
        return scipy.sparse.csr_matrix((shares, columns, starts), (point_count, self.surfels + self.lamps))

    def _escaped_counts(self, escaped: RayBatch, point_count: int) -> Floats:
        """The number (P,) of escaped rays of each point that crossed no pane that shows the sky."""
        crosses_no_pane = ~self.visibility.crosses_sky_pane(escaped.origins_m, FAR_M * escaped.directions)
        return np.bincount(escaped.point, crosses_no_pane, minlength=point_count).astype(np.float32)

    def _add_sky(self, sky: Floats, escaped: RayBatch) -> None:
        """Add the illuminance of points (K, P) by each sky along escaped rays."""
        for index, light in enumerate(self.skies):
            luminance_cd_m2 = light.luminance_cd_m2(escaped.directions)
            ray_lx = np.pi * luminance_cd_m2 * escaped.weight
            sky[index] += np.bincount(escaped.point, ray_lx, minlength=sky.shape[1])


def turned(points: Texels, turn: int) -> Texels:
    """The points with random numbers that differ from those of any other turn."""
    dither = points.dither + np.float32(turn) * TURN
    dither -= np.floor(dither)
    return replace(points, dither=dither)
