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

# The step of the two random numbers of a point from one pass to the next: the fractional parts of √2 and √3.
PASS_STEP = np.array([0.4142135624, 0.7320508076], np.float32)
MOST_REFLECTIONS = 4  # the largest number of mirror reflections of a ray
POINTS_PER_CHUNK = 1 << 9  # the number of points whose rays are traced at a time
MOST_RAYS = 25_000_000  # the largest number of rays in a table
PHOTONS_PER_CHUNK = 1 << 16  # the number of photons that are traced at a time


@dataclass(frozen=True, slots=True)
class FinalGather:
    """The result of rays from P points.

    `table` (P, S + L) is the illuminance of each point for a radiosity of 1 of each of S surfels and L lamps.
    `sky` (K, P) is the illuminance in lx of each point by each of K skies, as reflected by mirrors.
    `hits` (H·W,) is the number of rays that ended on each texel of the light map.
    `escaped` (P,) is the share of the rays of each point that left the scene without a reflection. Rays that left it
    through a pane that shows the sky are not counted.

    The illuminance of the points is the product of `table` and the radiosity (S + L,) of surfels and lamps, plus `sky`.
    """

    table: "csr_matrix"
    sky: Floats
    hits: Rows
    escaped: Floats


@dataclass(frozen=True, slots=True)
class Sample:
    """The result of some of the rays from P points.

    `near` (P, S + L) is a table as in `FinalGather`, of the rays that end near, as defined by `RayEnds.is_near`.
    `far` (P, S + L) is the same table of the other rays.
    `sky` (K, P) is the illuminance in lx by each sky, as in `FinalGather`.
    `escaped` (P,) is the share of rays that left the scene, as in `FinalGather`.
    `texels` (R,) are the indices of the texels on which rays ended, one for each ray that ended on a face.
    """

    near: "csr_matrix"
    far: "csr_matrix"
    sky: Floats
    escaped: Floats
    texels: Indices


@dataclass(frozen=True, slots=True)
class Photons:
    """R photons that leave reflecting faces.

    `origins_m` (R, 3) are their origins in the world.
    `directions` (R, 3) are their unit directions in the world.
    `flux_lm` (R,) is the flux of each photon in lumens.
    `is_shown` (R,) is whether the light of a photon is already counted on the first face that it meets, as direct light
    from the image of a lamp in a mirror.
    `dither` (R, 2) are two random numbers of each photon in [0, 1).
    """

    origins_m: Floats
    directions: Floats
    flux_lm: Floats
    is_shown: Mask
    dither: Floats


@dataclass(frozen=True, slots=True)
class Gatherer:
    """Casts rays from points, and records where they end.

    `atlas` is the layout of the light map, which has H x W texels.
    `visibility` casts the rays at the static faces.
    `response` is how each face scatters light.
    `skies` are the K skies.
    `surfel_of` (H·W,) is the index of the surfel of each texel, -1 for none.
    `surfels` is the number S of surfels.
    `lamps` is the number L of lamps.
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
        """Cast about `rays` rays from every point, or fewer if there would be more than MOST_RAYS in total.

        Rays are cast on a square grid of directions, so the number of rays of a point is a square number.
        `done` is called with the share of the work that is done.
        """
        rays_per_point = min(rays, MOST_RAYS / max(len(points), 1))
        side = int(np.sqrt(rays_per_point))
        sample = self.sample(points, side=side, done=done)
        return FinalGather(
            table=sample.near + sample.far,
            sky=sample.sky,
            hits=self.hits(sample),
            escaped=sample.escaped,
        )

    def hits(self, sample: Sample) -> Rows:
        """The number of rays of a sample that ended on each texel of the map (H·W,)."""
        return np.bincount(sample.texels, minlength=self.atlas.height * self.atlas.width)

    def sample(
        self,
        points: Texels,
        *,
        side: int,
        pass_index: int = 0,
        done: Callable[[float], object] | None = None,
    ) -> Sample:
        """Cast side x side rays from every point. Passes with another `pass_index` cast them in other directions.

        `done` is called with the share of the work that is done.
        """
        if not side or not len(points):
            return self._empty_sample(len(points))
        points_of_pass = with_new_random_numbers(points, pass_index)

        def sample_of(part: slice) -> Sample:
            return self._sample(points_of_pass.take(part), side)

        parts = in_chunks(sample_of, len(points), chunk=POINTS_PER_CHUNK, done=done)
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
        pass_index: int,
    ) -> tuple[Floats, Floats, Floats]:
        """The light that side x side rays from every point gather.

        `radiosity` (S, C) is the radiosity of the surfels in C channels.
        `pass_index` is as in `sample`.

        Returns three arrays: the light (P, C) from near surfels, the light (P, C) from far surfels, and the illuminance
        (K, P) in lx by each sky, as reflected by mirrors.
        """
        points_of_pass = with_new_random_numbers(points, pass_index)

        def light_of(part: slice) -> tuple[Floats, Floats, Floats]:
            sample = self._sample(points_of_pass.take(part), side)
            near = sample.near @ radiosity
            far = sample.far @ radiosity
            return near, far, sample.sky

        parts = in_chunks(light_of, len(points), chunk=POINTS_PER_CHUNK)
        near, far, sky = zip(*parts, strict=True)
        return np.concatenate(near), np.concatenate(far), np.concatenate(sky, 1)

    def deposited(self, photons: Photons) -> Floats:
        """The flux (S,) in lumens that photons deposit on surfels. On a coated surfel it is the flux below the coat."""
        flux_lm = np.zeros(self.surfels)
        photon_count = len(photons.flux_lm)
        rows = np.arange(photon_count, dtype=np.int32)

        def trace(part: slice) -> Floats:
            return self._deposited(photons, rows[part])

        for part_lm in in_chunks(trace, photon_count, chunk=PHOTONS_PER_CHUNK):
            flux_lm += part_lm
        return flux_lm

    def _sample(self, points: Texels, side: int) -> Sample:
        """The result of side x side rays from every point."""
        ray_count = np.float32(side * side)
        sky = np.zeros((len(self.skies), len(points)), np.float32)
        escaped = np.zeros(len(points), np.float32)
        batch = hemisphere_rays(points, side)
        parts = []
        for depth in range(MOST_REFLECTIONS + 1):
            followed = self._tracer.follow(batch, points.dither, is_first=depth == 0)
            parts.append(followed.ends)
            if depth == 0:
                escaped += self._escaped_counts(followed.escaped, len(points)) / ray_count
            else:
                self._add_sky(sky, followed.escaped)
            batch = followed.onward
            if not len(batch.point):
                break
        joined = joined_ends(parts)
        ends = joined._replace(share=joined.share / ray_count)
        return Sample(
            near=self._table(ends, ends.is_near, len(points)),
            far=self._table(ends, ~ends.is_near, len(points)),
            sky=sky / ray_count,
            escaped=escaped,
            texels=ends.texel,
        )

    def _deposited(self, photons: Photons, rows: Indices) -> Floats:
        """The flux (S,) in lumens that the photons at rows (N,) deposit on surfels."""
        flux_lm = np.zeros(self.surfels)
        batch = RayBatch(
            point=rows,
            origins_m=photons.origins_m[rows],
            directions=photons.directions[rows],
            weight=np.ones(len(rows), np.float32),
            is_direct=photons.is_shown[rows],
        )
        # The light of shown photons on the first face is already counted as direct light. Therefore only their
        # reflections are followed, together with the first reflections of the other photons.
        shown = batch.take(batch.is_direct)
        batch = batch.take(~batch.is_direct)
        reflections_of_shown = self._tracer.follow(shown, photons.dither, is_first=False).onward
        for depth in range(MOST_REFLECTIONS):
            followed = self._tracer.follow(batch, photons.dither, is_first=False)
            batch = followed.onward
            if depth == 0:
                batch = batch.joined(reflections_of_shown)
            ends = followed.ends
            is_surfel = ends.column < self.surfels
            arriving_lm = ends.share[is_surfel] * photons.flux_lm[ends.point[is_surfel]]
            flux_lm += np.bincount(ends.column[is_surfel], arriving_lm, self.surfels)
            if not len(batch.point):
                break
        return flux_lm

    def _table(self, ends: RayEnds, selected: Mask, point_count: int) -> "csr_matrix":
        """The sparse table (P, S + L) of the ends of the selected rays (R,), with one entry for each ray."""
        count = np.count_nonzero(selected)
        starts = np.empty(point_count + 1, np.int32)
        columns = np.empty(count, np.int32)
        shares = np.empty(count, np.float32)
        sorted_by_point(ends.point, ends.column, ends.share, selected, starts, columns, shares)
        return scipy.sparse.csr_matrix((shares, columns, starts), (point_count, self.surfels + self.lamps))

    def _escaped_counts(self, escaped: RayBatch, point_count: int) -> Floats:
        """The number (P,) of escaped rays of each point, without those that crossed a pane that shows the sky."""
        crosses_no_pane = ~self.visibility.crosses_sky_pane(escaped.origins_m, FAR_M * escaped.directions)
        return np.bincount(escaped.point, crosses_no_pane, minlength=point_count).astype(np.float32)

    def _add_sky(self, sky: Floats, escaped: RayBatch) -> None:
        """Add the light of each sky along escaped rays to `sky` (K, P), which is in lx."""
        for index, light in enumerate(self.skies):
            luminance_cd_m2 = light.luminance_cd_m2(escaped.directions)
            ray_lx = np.pi * luminance_cd_m2 * escaped.weight
            sky[index] += np.bincount(escaped.point, ray_lx, minlength=sky.shape[1])


def with_new_random_numbers(points: Texels, pass_index: int) -> Texels:
    """The points with other random numbers for each pass. In pass 0 the random numbers stay the same."""
    dither = points.dither + np.float32(pass_index) * PASS_STEP
    dither -= np.floor(dither)
    return replace(points, dither=dither)
