"""Light that lamps and the sun give by way of coats, metal, mirrors and panes, carried by photons."""

from collections.abc import Sequence

import numpy as np

from vobench import stop
from vobench.rendering.array_types import Floats, Indices, Rows
from vobench.rendering.emitter import Emitter
from vobench.rendering.geometry import offset_from_surface, reversed_faces, sample_points
from vobench.rendering.indirect_light import FAINT, Gatherer, Photons, facets
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import in_chunks
from vobench.scene.mesh import areas_m2

PHOTONS = 1 << 21  # of all lights together
FEWEST = 1 << 14  # of an emitter
PLACES = 1 << 15  # on panes and mirrors, which have no texels
TYPICAL_COSINE = np.float32(0.6)  # at which the share that a face mirrors decides how many photons start there
# the shares of photons that start on texels in proportion to their light, evenly on texels, and on panes and mirrors
BY_LIGHT = 0.5
EVENLY = 0.2
CHUNK = 1 << 15


class Reflectors:
    """Places of a scene that mirror light, where photons set out: texels, and places on panes and mirrors."""

    def __init__(
        self,
        gatherer: Gatherer,
        points: Texels,
        point_areas_m2: Floats,
        seed: int,
    ) -> None:
        self._gatherer = gatherer
        visibility = gatherer.visibility
        self._is_pane = visibility.is_pane
        faces = visibility.faces
        mirrored = self._mirrored(points.face, np.full(len(points), TYPICAL_COSINE))
        self.texels = np.flatnonzero(mirrored > FAINT)

        # Panes and mirrors. A pane that has one side in the table mirrors on both.
        every = np.arange(len(faces), dtype=np.int32)
        face_mirrors = self._mirrored(every, np.full(len(faces), TYPICAL_COSINE))
        is_bare = visibility.is_static & ~gatherer.response.scatters[:-1] & (face_mirrors > FAINT)
        bare = np.flatnonzero(is_bare)
        is_single = self._is_pane[bare] & (reversed_faces(faces.corners_m)[bare] < 0)
        bare = np.concatenate([bare, bare[is_single]])
        sign = np.ones(len(bare), np.float32)
        sign[len(bare) - np.count_nonzero(is_single) :] = -1

        place_count = PLACES if len(bare) else 0
        number = np.random.default_rng([seed, 2]).random((2, place_count))
        along = (np.arange(place_count) + number[0]) / max(place_count, 1)
        corners_m = faces.corners_m[bare]
        bare_areas_m2 = areas_m2(corners_m)
        ends_m2 = np.cumsum(bare_areas_m2)
        nth = np.zeros(0, np.int64)
        places_m = np.zeros((0, 3))
        if place_count:
            nth = np.searchsorted(ends_m2, along * ends_m2[-1], side="right")
            nth = np.minimum(nth, len(bare) - 1)
            places_m = sample_points(corners_m, along, number[1])
        normals = faces.plane[bare[nth]] * sign[nth, None]
        places_m = offset_from_surface(places_m, normals)
        place_area_m2 = ends_m2[-1] / place_count if place_count else 0.0

        self._points_m = np.concatenate([points.points_m[self.texels], places_m]).astype(np.float32)
        no_step = np.zeros((place_count, 3))
        self._step_u_m = np.concatenate([points.step_u_m[self.texels], no_step]).astype(np.float32)
        self._step_v_m = np.concatenate([points.step_v_m[self.texels], no_step]).astype(np.float32)
        self._normals = np.concatenate([points.planes[self.texels], normals]).astype(np.float32)
        self._face = np.concatenate([points.face[self.texels], bare[nth]]).astype(np.int32)
        self._area_m2 = np.concatenate([point_areas_m2[self.texels], np.full(place_count, place_area_m2)])
        self._weight = self._area_m2 * self._mirrored(self._face, np.full(len(self._face), TYPICAL_COSINE))

    def __len__(self) -> int:
        return len(self._face)

    def _mirrored(self, face: Indices, cosine: Floats) -> Floats:
        """The share (P,) that faces (P,) mirror."""
        share = self._gatherer.response.mirrored(face, cosine)
        panes = np.flatnonzero(self._is_pane[face])
        share[panes] = self._gatherer.visibility.pane_mirrors(face[panes], cosine[panes])
        return share

    def flux_lm(
        self,
        emitters: Sequence[Emitter],
        light_lx: Floats,
        *,
        effort: float,
        seed: Sequence[int],
    ) -> Floats:
        """The flux (2, S) in lumens of a light of several emitters by way of mirroring faces, by two sets of photons.

        light_lx (P,): its direct light on all texels; effort: the share of all PHOTONS.
        """
        flux_lm = np.zeros((2, self._gatherer.surfels))
        if not len(self):
            return flux_lm
        chance = self._chances(light_lx)
        for nth, emitter in enumerate(emitters):
            count = max(FEWEST, int(PHOTONS * effort / len(emitters)))
            for half in (0, 1):
                stop.check()
                photons = self._emitted(emitter, chance, count // 2, [*seed, nth, half])
                flux_lm[half] += self._gatherer.deposited(photons)
        return flux_lm

    def _chances(self, light_lx: Floats) -> Floats:
        """The probability of each place to be where a photon starts, for the direct light (P,) of all texels."""
        texel_count = len(self.texels)
        texel_weight = self._weight[:texel_count]
        parts = [
            (BY_LIGHT, np.arange(texel_count), texel_weight * np.sqrt(np.maximum(light_lx[self.texels], 0))),
            (EVENLY, np.arange(texel_count), texel_weight),
            (1 - BY_LIGHT - EVENLY, np.arange(texel_count, len(self)), self._weight[texel_count:]),
        ]
        chance = np.zeros(len(self))
        for share, rows, weight in parts:
            if weight.sum() > 0:
                chance[rows] += share * weight / weight.sum()
        return np.asarray(chance / max(chance.sum(), 1e-30))

    def _emitted(
        self,
        emitter: Emitter,
        chance: Floats,
        count: int,
        seed: Sequence[int],
    ) -> Photons:
        """About `count` photons of an emitter, each as it leaves the first face that mirrors it."""
        ends = np.cumsum(chance)

        def start(part: slice) -> Photons:
            random = np.random.default_rng([*seed, part.start])
            number = random.random((7, part.stop - part.start), dtype=np.float32)
            sample = (np.arange(part.start, part.stop) + number[0]) / count * ends[-1]
            place = np.minimum(np.searchsorted(ends, sample, side="right"), len(self) - 1)
            return self._photons(emitter, place, 1 / (count * chance[place]), number[1:])

        parts = in_chunks(start, count, chunk=CHUNK)
        return Photons(
            origins_m=np.concatenate([part.origins_m for part in parts]),
            directions=np.concatenate([part.directions for part in parts]),
            flux_lm=np.concatenate([part.flux_lm for part in parts]),
            is_shown=np.concatenate([part.is_shown for part in parts]),
            dither=np.concatenate([part.dither for part in parts]),
        )

    def _photons(
        self,
        emitter: Emitter,
        place: Rows,
        weight: Floats,
        number: Floats,
    ) -> Photons:
        """Photons from places (P,), which stand for `weight` (P,) places each, by six numbers (6, P) in [0, 1)."""
        visibility = self._gatherer.visibility
        response = self._gatherer.response
        points = self._texels(place, number[:4])
        flux_m2 = (self._area_m2[place] * weight).astype(np.float32)

        # A ray to somewhere on the emitter.
        ahead_m = np.einsum("ij,ij->i", emitter.ball.centre_m - points.points_m, points.planes)
        rows = np.flatnonzero((ahead_m > -emitter.ball.radius_m) & emitter.may_light(points.points_m))
        points = points.take(rows)
        vectors_m, strength = emitter.towards(points)(number[4, rows], number[5, rows])
        cosine = points.cosine(vectors_m)
        flux_lm = strength * np.maximum(cosine, 0) * flux_m2[rows]
        lit = np.flatnonzero(flux_lm > 0)
        points = points.take(lit)
        vectors_m = vectors_m[lit]
        flux_lm = flux_lm[lit] * self._mirrored(points.face, cosine[lit])
        flux_lm *= emitter.passing(visibility, points.points_m, vectors_m)
        passed = np.flatnonzero(flux_lm > 0)
        points = points.take(passed)
        incoming = vectors_m[passed] / np.linalg.norm(vectors_m[passed], axis=1, keepdims=True)

        # The mirrored ray.
        roughness = np.where(self._is_pane[points.face], 0, response.roughness[points.face])
        normals = facets(points.planes, roughness, points.dither, np.arange(len(points)))
        along_normal = np.einsum("ij,ij->i", incoming, normals)[:, None]
        directions = (2 * along_normal * normals - incoming).astype(np.float32)
        is_leaving = np.einsum("ij,ij->i", directions, points.planes) > 0
        is_shown = response.shows_lamps[points.face]
        return Photons(
            points.points_m[is_leaving],
            directions[is_leaving],
            flux_lm[passed][is_leaving].astype(np.float32),
            is_shown[is_leaving],
            points.dither[is_leaving],
        )

    def _texels(self, place: Rows, number: Floats) -> Texels:
        """Somewhere on the area of places (P,), as texels without a coat, so that all light that arrives counts."""
        count = len(place)
        across = number[2:] - np.float32(0.5)
        aside_m = across[0][:, None] * self._step_u_m[place] + across[1][:, None] * self._step_v_m[place]
        no_step = np.zeros((count, 3), np.float32)
        return Texels(
            points_m=self._points_m[place] + aside_m,
            normals=self._normals[place],
            planes=self._normals[place],
            step_u_m=no_step,
            step_v_m=no_step,
            index=np.zeros(count, np.int64),
            face=self._face[place],
            uv=np.zeros((count, 2), np.float32),
            eta=np.zeros(count, np.float32),
            dither=np.ascontiguousarray(number[:2].T),
        )
