"""Gathering with as many rays as the light's error asks for, and smoothing of light that comes from afar."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench import stop
from vobench.rendering.array_types import Floats, Mask, Rows
from vobench.rendering.indirect_light import Gatherer
from vobench.rendering.texel import Texels

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

SMOOTHINGS = 4  # times that light from afar is averaged over neighbouring surfels
PROBES = 8  # random patterns by which the noise of smoothed light is found
DARK = 0.1  # of the mean light: noise of darker places is compared with this
FAINTEST = 1e-9  # in lux, of a scene without light
MOST_ROUNDS = 8  # of rays from a surfel
ALONE = 1e-3  # weight by which the noise of a surfel counts for itself, where it has no neighbours
FEWEST = 0.002  # share of the surfels for which another round is worth its overhead


@dataclass(frozen=True, slots=True)
class Gathered:
    """What surfels (S,) receive: near and far (S, S) times their radiosity.

    sky_lx (K, S): the light of skies by way of mirrors, smoothed; noise (S,): the standard error of the light shown
    there, relative to all light.
    """

    near: "csr_matrix"
    far: "csr_matrix"
    sky_lx: Floats
    noise: Floats


class Smoothing:
    """Averages over neighbouring surfels, by the weights (S, S) with which they light each other's middles.

    One step exchanges light between neighbours, symmetrically, so that even light stays and none is lost.
    """

    def __init__(self, weights: "csr_matrix") -> None:
        self._weights = weights
        exchanged = weights.minimum(weights.T).tocsr()
        exchanged = exchanged - scipy.sparse.diags_array(exchanged.diagonal())
        kept = 1 - np.asarray(exchanged.sum(1)).ravel()
        self._step = (exchanged + scipy.sparse.diags_array(kept.astype(np.float32))).tocsr()

    def blended(self, values: Floats) -> Floats:
        """Values (S, ...) as the light map shows them at the middles of the surfels."""
        return np.asarray(self._weights @ values)

    def averaged(self, values: Floats) -> Floats:
        """Values (S, ...) averaged over a neighbourhood, whose sum stays."""
        for _ in range(SMOOTHINGS):
            values = self._step @ values
        return np.asarray(values, np.float32)

    def density(self, flux: Floats, area_m2: Floats) -> Floats:
        """Flux (S, C) per area (S,), of surfels and their neighbours together."""
        around = self.averaged(np.column_stack([flux, area_m2]))
        return np.asarray(around[:, :-1] / np.maximum(around[:, -1:], 1e-12), np.float32)


class Rounds:
    """Rays from surfels, in rounds of two halves that are compared: surfel by surfel, the difference is the noise."""

    def __init__(
        self,
        gatherer: Gatherer,
        middles: Texels,
        *,
        side: int,
        done: Callable[[float], object] | None = None,
    ) -> None:
        self._gatherer = gatherer
        self._middles = middles
        self._side = side
        halves = []
        for half in (0, 1):

            def half_done(share: float, half: int = half) -> None:
                if done:
                    done((half + share) / 2)

            halves.append(gatherer.sample(middles, side=side, turn=half, done=half_done))
        self._halves = halves
        self.escaped = (halves[0].escaped + halves[1].escaped) / 2
        self.hits = gatherer.hits(halves[0]) + gatherer.hits(halves[1])

    def table(self) -> "csr_matrix":
        """What the first round found (S, S)."""
        surfels = self._gatherer.surfels
        total = sum(half.near + half.far for half in self._halves)
        return (total / 2)[:, :surfels].tocsr()

    def met(self) -> Floats:
        """The share (S,) of rays of the first round that found light."""
        tables = [half.near + half.far for half in self._halves]
        return np.asarray(sum(table.sum(1) for table in tables)).ravel() / 2

    def sky_lx(self) -> Floats:
        """The illuminance (K, S) by skies in mirrors that the first round found."""
        return (self._halves[0].sky + self._halves[1].sky) / 2

    def refined(
        self,
        smoothing: Smoothing,
        *,
        radiosity: Floats,
        sky_weights: Floats,
        direct: Floats,
        by_mirrors: Floats,
        noise: float,
        done: Callable[[float], object] | None = None,
    ) -> Gathered:
        """Send further rays from surfels whose light is noisier than `noise`.

        radiosity (S,), direct light (S,) and light by mirrors, by two sets of photons (2, S), are luminances, of all
        lights together; sky_weights (K,): the luminance of the colour of each sky.
        """
        surfels = self._gatherer.surfels
        count = len(self._middles)
        rounds = np.ones(count, np.int64)
        other_light = smoothing.blended(direct + by_mirrors.mean(0))
        first, second = self._halves
        near = (first.near + second.near)[:, :surfels].tocsr()
        far = (first.far + second.far)[:, :surfels].tocsr()
        near_halves = np.stack([half.near[:, :surfels] @ radiosity for half in self._halves])
        far_halves = np.stack([half.far[:, :surfels] @ radiosity + sky_weights @ half.sky for half in self._halves])
        sky = first.sky + second.sky
        self._halves = []
        while True:
            stop.check()
            found = _noise(smoothing, near_halves / rounds, far_halves / rounds, rounds, other_light)
            rows = np.flatnonzero((found > noise) & (rounds < MOST_ROUNDS))
            if len(rows) <= FEWEST * count:
                break
            passed = int(rounds[rows].max())
            for repeat in range(passed):
                for half in (0, 1):
                    sample = self._gatherer.sample(
                        self._middles.take(rows), side=self._side, turn=2 * (passed + repeat) + half
                    )
                    rows_near = sample.near[:, :surfels]
                    rows_far = sample.far[:, :surfels]
                    near_halves[half, rows] += rows_near @ radiosity
                    far_halves[half, rows] += rows_far @ radiosity + sky_weights @ sample.sky
                    sky[:, rows] += sample.sky
                    near = near + _at_rows(rows_near, rows, count)
                    far = far + _at_rows(rows_far, rows, count)
            rounds[rows] += passed
            if done:
                done(np.log2(2 * passed) / np.log2(2 * MOST_ROUNDS))
        by_photons = smoothing.blended((by_mirrors[0] - by_mirrors[1]) / 2)
        photon_variance = smoothing.averaged(by_photons**2)
        light = _relative_to(smoothing.blended((near_halves + far_halves).mean(0) / rounds) + other_light)
        found = np.sqrt(found**2 + photon_variance / light**2)
        share = scipy.sparse.diags_array((1 / (2 * rounds)).astype(np.float32))
        return Gathered(
            (share @ near).tocsr(), (share @ far).tocsr(), smoothing.averaged((sky / (2 * rounds)).T).T, found
        )


def _at_rows(table: "csr_matrix", rows: Rows, count: int) -> "csr_matrix":
    """A table (N, S) as rows (N,) of one with `count` rows."""
    entries = np.zeros(count, np.int64)
    entries[rows] = np.diff(table.indptr)
    starts = np.concatenate([[0], np.cumsum(entries)])
    return scipy.sparse.csr_matrix((table.data, table.indices, starts), (count, table.shape[1]))


def _of_others(smoothing: Smoothing, variance: Floats, is_even: Mask) -> Floats:
    """Variances (S,) averaged over neighbours of the other of two kinds, even and odd ones.

    So no surfel is given more rays for what its own ones have found, or few bright rays would count too little.
    """
    weights = np.column_stack([is_even + ALONE, ~is_even + ALONE])
    of_kind = smoothing.averaged(variance[:, None] * weights) / smoothing.averaged(weights)
    return np.where(is_even, of_kind[:, 1], of_kind[:, 0])


def _relative_to(light: Floats) -> Floats:
    """The light (S,) that noise is compared with."""
    darkest = max(DARK * float(light.mean()), FAINTEST)
    return np.asarray(np.maximum(light, darkest))


def _noise(
    smoothing: Smoothing,
    near_halves: Floats,
    far_halves: Floats,
    rounds: Rows,
    other_light: Floats,
) -> Floats:
    """The standard error (S,) of the light that is shown at surfels, relative to all light, by its halves (2, S).

    Variances are averages over neighbours, as two halves alone say little. How much of them smoothing leaves is found
    by smoothing random patterns.
    """
    far = smoothing.averaged(far_halves.mean(0))
    light = smoothing.blended(near_halves.mean(0) + far) + other_light
    light = _relative_to(light)

    # Of one round: what a mean of several has is smaller by their number.
    random = np.random.default_rng(0)
    is_even = random.random(len(rounds)) < 0.5
    deviations = []
    for halves in (near_halves, far_halves):
        variance = _of_others(smoothing, rounds * (halves[0] - halves[1]) ** 2 / 4, is_even)
        deviations.append(np.sqrt(variance / rounds))
    sign = random.integers(0, 2, (2, len(rounds), PROBES)).astype(np.float32) * 2 - 1
    near_pattern = deviations[0][:, None] * sign[0]
    far_pattern = smoothing.averaged(deviations[1][:, None] * sign[1])
    shown = smoothing.blended((near_pattern + far_pattern).astype(np.float32))
    variance = smoothing.blended((shown**2).mean(1))
    return np.asarray(np.sqrt(variance) / light)
