"""Adaptive gathering, with more rays where indirect light is noisy, and smoothing of light from far surfels."""

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

SMOOTHINGS = 4  # how often light from far surfels is averaged over neighbouring surfels
PROBES = 8  # the number of random patterns from which the noise after smoothing is estimated
DARK = 0.1  # the noise of a place darker than this share of the mean light is relative to this share
FAINTEST = 1e-9  # the smallest light in lux that noise is relative to, for a scene without light
MOST_ROUNDS = 8  # the largest number of rounds of rays from a surfel
ALONE = 1e-3  # the weight of a surfel's own variance, which matters only without neighbours
FEWEST = 0.002  # the share of noisy surfels up to which another round is not worth its overhead


@dataclass(frozen=True, slots=True)
class Gathered:
    """The indirect light that S surfels receive.

    `near` and `far` (S, S) map the radiosity of all surfels to the light that comes from near and from far surfels.
    `sky_lx` (K, S) is the smoothed light of each sky via mirrors.
    `noise` (S,) is the standard error of the light that is shown at each surfel, relative to all light.
    """

    near: "csr_matrix"
    far: "csr_matrix"
    sky_lx: Floats
    noise: Floats


class Smoothing:
    """Averages values over neighbouring surfels.

    `weights` (S, S) are the weights of all surfels in the light map at the centre of each surfel. Each step exchanges
    equal shares between neighbours, so it preserves constant values and the sum.
    """

    def __init__(self, weights: "csr_matrix") -> None:
        self._weights = weights
        exchanged = weights.minimum(weights.T).tocsr()
        exchanged = exchanged - scipy.sparse.diags_array(exchanged.diagonal())
        remaining = 1 - np.asarray(exchanged.sum(1)).ravel()
        self._step = (exchanged + scipy.sparse.diags_array(remaining.astype(np.float32))).tocsr()

    def blended(self, values: Floats) -> Floats:
        """The values (S, ...) as the light map shows them at the centres of the surfels."""
        return np.asarray(self._weights @ values)

    def averaged(self, values: Floats) -> Floats:
        """The values (S, ...) averaged over neighbouring surfels; their sum is preserved."""
        for _ in range(SMOOTHINGS):
            values = self._step @ values
        return np.asarray(values, np.float32)

    def density(self, flux: Floats, area_m2: Floats) -> Floats:
        """The flux density (S, C) from the flux and the area (S,), each averaged over neighbouring surfels."""
        averages = self.averaged(np.column_stack([flux, area_m2]))
        return np.asarray(averages[:, :-1] / np.maximum(averages[:, -1:], 1e-12), np.float32)


class Rounds:
    """The rays from surfels, in rounds.

    Each round has two independent halves; their difference is an estimate of the noise.
    """

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
        """The matrix (S, S) of the first round, which maps the radiosity of surfels to the light that they receive."""
        surfels = self._gatherer.surfels
        total = sum(half.near + half.far for half in self._halves)
        return (total / 2)[:, :surfels].tocsr()

    def met(self) -> Floats:
        """The share (S,) of the rays of the first round that ended at a surfel or a lamp."""
        tables = [half.near + half.far for half in self._halves]
        return np.asarray(sum(table.sum(1) for table in tables)).ravel() / 2

    def sky_lx(self) -> Floats:
        """The illuminance (K, S) by each sky via mirrors, from the first round."""
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
        """The gathered light after further rays from all surfels whose relative standard error exceeds `noise`.

        `radiosity` (S,), `direct` (S,) and `by_mirrors` (2, S), from two sets of photons, are luminances of all lights
        together.
        `sky_weights` (K,) is the luminance of the colour of each sky.
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
            standard_error = _noise(smoothing, near_halves / rounds, far_halves / rounds, rounds, other_light)
            rows = np.flatnonzero((standard_error > noise) & (rounds < MOST_ROUNDS))
            if len(rows) <= FEWEST * count:
                break
            round_count = int(rounds[rows].max())
            for repeat in range(round_count):
                for half in (0, 1):
                    sample = self._gatherer.sample(
                        self._middles.take(rows), side=self._side, turn=2 * (round_count + repeat) + half
                    )
                    rows_near = sample.near[:, :surfels]
                    rows_far = sample.far[:, :surfels]
                    near_halves[half, rows] += rows_near @ radiosity
                    far_halves[half, rows] += rows_far @ radiosity + sky_weights @ sample.sky
                    sky[:, rows] += sample.sky
                    near = near + _at_rows(rows_near, rows, count)
                    far = far + _at_rows(rows_far, rows, count)
            rounds[rows] += round_count
            if done:
                done(np.log2(2 * round_count) / np.log2(2 * MOST_ROUNDS))
        by_photons = smoothing.blended((by_mirrors[0] - by_mirrors[1]) / 2)
        photon_variance = smoothing.averaged(by_photons**2)
        light = _relative_to(smoothing.blended((near_halves + far_halves).mean(0) / rounds) + other_light)
        standard_error = np.sqrt(standard_error**2 + photon_variance / light**2)
        inverse_counts = scipy.sparse.diags_array((1 / (2 * rounds)).astype(np.float32))
        return Gathered(
            (inverse_counts @ near).tocsr(),
            (inverse_counts @ far).tocsr(),
            smoothing.averaged((sky / (2 * rounds)).T).T,
            standard_error,
        )


def _at_rows(table: "csr_matrix", rows: Rows, count: int) -> "csr_matrix":
    """A table with `count` rows: those of a table (N, S) at the indices `rows` (N,), and empty rows elsewhere."""
    entries = np.zeros(count, np.int64)
    entries[rows] = np.diff(table.indptr)
    starts = np.concatenate([[0], np.cumsum(entries)])
    return scipy.sparse.csr_matrix((table.data, table.indices, starts), (count, table.shape[1]))


def _of_others(smoothing: Smoothing, variance: Floats, is_even: Mask) -> Floats:
    """The variances (S,), averaged over the neighbours in the other one of two random groups.

    `is_even` (S,) is whether a surfel is in the first group. Thus the rays of a surfel do not decide whether it gets
    more rays. If they did, rare bright rays would get too small a weight.
    """
    weights = np.column_stack([is_even + ALONE, ~is_even + ALONE])
    of_kind = smoothing.averaged(variance[:, None] * weights) / smoothing.averaged(weights)
    return np.where(is_even, of_kind[:, 1], of_kind[:, 0])


def _relative_to(light: Floats) -> Floats:
    """The light (S,) that noise is relative to: the given light, or a minimum in dark places."""
    darkest = max(DARK * float(light.mean()), FAINTEST)
    return np.asarray(np.maximum(light, darkest))


def _noise(
    smoothing: Smoothing,
    near_halves: Floats,
    far_halves: Floats,
    rounds: Rows,
    other_light: Floats,
) -> Floats:
    """The standard error (S,) of the light that is shown at surfels, relative to all light.

    It is estimated from the two halves (2, S) of near light and of far light. Variances are averaged over neighbours,
    because two values give a poor estimate. Random patterns are smoothed to find how much noise smoothing leaves.
    """
    far = smoothing.averaged(far_halves.mean(0))
    light = smoothing.blended(near_halves.mean(0) + far) + other_light
    light = _relative_to(light)

    # `variance` is that of one round. The variance of the mean of several rounds is smaller by their number.
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
