"""Light of lamps and the sun that coats, metals, mirrors and panes reflect, computed with photons."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from vobench import stop
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats, Indices, Rows
from vobench.rendering.emitter import Emitter
from vobench.rendering.geometry import offset_from_surface, reversed_faces, sample_points
from vobench.rendering.indirect_light import Gatherer, Photons
from vobench.rendering.ray_kernels import FAINT, facet_normals
from vobench.rendering.texel import Texels
from vobench.rendering.thread_pool import in_chunks

PHOTONS = 1 << 21  # the number of photons of all lights together
FEWEST = 1 << 14  # the smallest number of photons of an emitter
PLACES = 1 << 15  # the number of start points on panes and mirrors, which have no texels
TYPICAL_COSINE = np.float32(0.6)  # the cosine of incidence at which reflectances are compared to distribute photons
# The share of photons whose density on texels increases with the direct light, and the share with a uniform density on
# texels. All other photons start on panes and mirrors.
BY_LIGHT = 0.5
EVENLY = 0.2
# All photons are used if reflecting faces reflect this share of what texels scatter, fewer if it is less.
ALL_PHOTONS_SHARE = 0.2
LEAST_EFFORT = 1 / 16
CHUNK = 1 << 15  # the number of photons that a thread computes at a time


@dataclass(frozen=True, slots=True)
class _Places:
    """Points (N, 3) on reflecting faces, slightly off them, with normals (N, 3), faces (N,) and areas (N,) in m²."""

    points_m: Array
    normals: Array
    face: Rows
    area_m2: Array


class Reflectors:
    """The reflecting places of a scene, from which photons start: texels, followed by points on panes and mirrors.

    `texels` are the indices of the reflecting texels. Photons are not traced from an emitter to a place; instead, each
    place is connected to a random point on the emitter.
    """

    def __init__(
        self,
        gatherer: Gatherer,
        points: Texels,
        point_areas_m2: Floats,
        seed: int,
    ) -> None:
        self._gatherer = gatherer
        self.visibility = gatherer.visibility
        self._is_pane = self.visibility.is_pane
        mirrored = self._mirrored(points.face, np.full(len(points), TYPICAL_COSINE))
        self.texels = np.flatnonzero(mirrored > FAINT)
        on_faces = self._places_on_faces(seed)

        no_step = np.zeros_like(on_faces.points_m)
        self._points_m = np.concatenate([points.points_m[self.texels], on_faces.points_m]).astype(np.float32)
        self._step_u_m = np.concatenate([points.step_u_m[self.texels], no_step]).astype(np.float32)
        self._step_v_m = np.concatenate([points.step_v_m[self.texels], no_step]).astype(np.float32)
        self._normals = np.concatenate([points.planes[self.texels], on_faces.normals]).astype(np.float32)
        self._face = np.concatenate([points.face[self.texels], on_faces.face]).astype(np.int32)
        self._area_m2 = np.concatenate([point_areas_m2[self.texels], on_faces.area_m2])
        self._weight = self._area_m2 * self._mirrored(self._face, np.full(len(self._face), TYPICAL_COSINE))

    def _places_on_faces(self, seed: int) -> _Places:
        """Random points on the panes and mirrors, which have no texels: PLACES, or none if there are no such faces."""
        faces = self.visibility.faces
        face, sign = self._mirror_faces()
        if not len(face):
            no_places_m = np.zeros((0, 3))
            return _Places(no_places_m, no_places_m, face, np.zeros(0))

        # Random points that are stratified over the total area.
        random_a, random_b = np.random.default_rng([seed, 2]).random((2, PLACES))
        stratified = (np.arange(PLACES) + random_a) / PLACES
        corners_m = faces.corners_m[face]
        on_surface_m = sample_points(corners_m, stratified, random_b)

        # The face of each point is the one that `sample_points` has chosen.
        ends_m2 = np.cumsum(areas_m2(corners_m))
        total_m2 = ends_m2[-1]
        row = np.searchsorted(ends_m2, stratified * total_m2, side="right")
        row = np.minimum(row, len(face) - 1)
        normals = faces.plane[face[row]] * sign[row, None]
        return _Places(
            points_m=offset_from_surface(on_surface_m, normals),
            normals=normals,
            face=face[row],
            area_m2=np.full(PLACES, total_m2 / PLACES),
        )

    def _mirror_faces(self) -> tuple[Rows, Floats]:
        """The reflecting faces (K,) without texels, and the side (K,) that reflects: 1 for the front, -1 for the back.

        A pane that consists of a single face reflects on both sides, so it is included twice.
        """
        faces = self.visibility.faces
        all_faces = np.arange(len(faces), dtype=np.int32)
        mirrored = self._mirrored(all_faces, np.full(len(faces), TYPICAL_COSINE))
        has_no_texels = self.visibility.is_static & ~self._gatherer.response.scatters[:-1]
        fronts = np.flatnonzero(has_no_texels & (mirrored > FAINT))
        has_back = reversed_faces(faces.corners_m)[fronts] >= 0
        single_panes = fronts[self._is_pane[fronts] & ~has_back]
        sign = np.ones(len(fronts) + len(single_panes), np.float32)
        sign[len(fronts) :] = -1
        return np.concatenate([fronts, single_panes]), sign

    def __len__(self) -> int:
        return len(self._face)

    def _mirrored(self, face: Indices, cosine: Floats) -> Floats:
        """The reflectance (P,) of faces (P,) at the given cosines of incidence."""
        share = self._gatherer.response.mirrored(face, cosine)
        panes = np.flatnonzero(self._is_pane[face])
        share[panes] = self._gatherer.visibility.pane_reflectance(face[panes], cosine[panes])
        return share

    def flux_lm(
        self,
        emitters: Sequence[Emitter],
        light_lx: Floats,
        *,
        effort: float,
        seed: Sequence[int],
    ) -> Floats:
        """The flux (2, S) in lumens that surfels receive from a light via reflecting faces, by two sets of photons.

        `emitters` are the parts of the light.
        `light_lx` (P,) is its direct illuminance on all texels.
        `effort` is the share of PHOTONS that is used for the light.
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

    def effort(self, light_lx: Floats, scattered_lm: float) -> float:
        """The share of PHOTONS that a light needs, given its direct illuminance (P,) on all texels.

        `scattered_lm` is the flux that texels scatter. The noise of photons matters by the share of the light that
        they carry, and it decreases with the square root of their number.
        """
        lit = light_lx[light_lx > 0]
        if not len(lit) or not len(self):
            return 1.0
        # The illuminance of panes and mirrors, which have no texels, is assumed to be the mean of lit texels.
        place_lx = np.full(len(self), lit.mean(dtype=float))
        place_lx[: len(self.texels)] = light_lx[self.texels]
        mirrored_lm = float((self._weight * place_lx).sum())
        share = mirrored_lm / max(scattered_lm, 1e-30)
        return float(np.clip((share / ALL_PHOTONS_SHARE) ** 2, LEAST_EFFORT, 1))

    def _chances(self, light_lx: Floats) -> Floats:
        """The probability that a photon starts at each place, given the direct light (P,) on all texels."""
        texel_count = len(self.texels)
        on_texels = slice(0, texel_count)
        on_faces = slice(texel_count, len(self))
        brightness = np.sqrt(np.maximum(light_lx[self.texels], 0))

        chance = np.zeros(len(self))
        chance[on_texels] += _with_sum(BY_LIGHT, self._weight[on_texels] * brightness)
        chance[on_texels] += _with_sum(EVENLY, self._weight[on_texels])
        chance[on_faces] += _with_sum(1 - BY_LIGHT - EVENLY, self._weight[on_faces])
        return np.asarray(chance / max(chance.sum(), 1e-30))

    def _emitted(
        self,
        emitter: Emitter,
        chance: Floats,
        count: int,
        seed: Sequence[int],
    ) -> Photons:
        """About `count` photons of an emitter, as they leave the first face that reflects them."""
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
        """The photons that leave places (P,), drawn with random numbers (6, P) in [0, 1).

        `weight` (P,) is the reciprocal of the expected number of photons from each place.
        """
        visibility = self.visibility
        response = self._gatherer.response
        points = self._texels(place, number[:4])
        flux_m2 = (self._area_m2[place] * weight).astype(np.float32)

        # A shadow ray to a random point on the emitter.
        ahead_m = np.einsum("ij,ij->i", emitter.ball.centre_m - points.points_m, points.planes)
        rows = np.flatnonzero((ahead_m > -emitter.ball.radius_m) & emitter.may_reach(points.points_m))
        points = points.take(rows)
        vectors_m, strength = emitter.towards(points)(number[4, rows], number[5, rows])
        cosine = points.cosine(vectors_m)
        flux_lm = strength * np.maximum(cosine, 0) * flux_m2[rows]
        lit = np.flatnonzero(flux_lm > 0)
        points = points.take(lit)
        vectors_m = vectors_m[lit]
        flux_lm = flux_lm[lit] * self._mirrored(points.face, cosine[lit])
        flux_lm *= emitter.transmittance(visibility, points.points_m, vectors_m)
        passed = np.flatnonzero(flux_lm > 0)
        points = points.take(passed)
        incoming = vectors_m[passed] / np.linalg.norm(vectors_m[passed], axis=1, keepdims=True)

        # The reflected ray. Roughness varies its normal.
        roughness = np.where(self._is_pane[points.face], 0, response.roughness[points.face])
        normals = points.planes.copy()
        facet_normals(normals, roughness.astype(np.float32), points.dither)
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
        """Random points in the areas of places (P,), as texels without a coat, so that all arriving light counts."""
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


def _with_sum(total: float, weights: Floats) -> Floats:
    """The weights (N,) scaled to a sum; 0 if all weights are 0."""
    if weights.sum() <= 0:
        return np.zeros(len(weights))
    return np.asarray(total * weights / weights.sum())
