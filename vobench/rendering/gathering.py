"""Adaptive gathering, with more rays where indirect light is noisy, and smoothing of light from far surfels."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import scipy

from vobench import stop
from vobench.rendering.array_types import Floats, Rows
from vobench.rendering.indirect_light import Gatherer, Sample
from vobench.rendering.texel import Texels

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix
    from scipy.sparse.linalg import LinearOperator

SMOOTHINGS = 4  # the number of times that light from far surfels is averaged over neighbouring surfels
VARIANCE_SMOOTHINGS = 2  # the number of times that variances are averaged
MOST_ROUNDS = 8  # the largest number of rounds of rays from a surfel
FEWEST = 0.002  # the share of noisy surfels up to which another round is not worth its overhead

# Noise is relative to the light, but at least to this share of the mean light, and at least to this illuminance in lx.
DARK = 0.1
FAINTEST = 1e-9


@dataclass(frozen=True, slots=True)
class Gathered:
    """The indirect light that S surfels receive from surfels and skies.

    `light_lx` (S, C) comes from the radiosity of surfels in C channels; light from far surfels is smoothed.
    `sky_lx` (K, S) is the smoothed light of each sky via mirrors.
    `noise` (S,) is the standard error of the light that is shown at each surfel, relative to all light.
    """

    light_lx: Floats
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
        hits = []
        for half in (0, 1):

            def half_done(share: float, half: int = half) -> None:
                if done:
                    done((half + share) / 2)

            sample = gatherer.sample(middles, side=side, pass_index=half, done=half_done)
            hits.append(gatherer.hits(sample))
            halves.append(replace(sample, texels=sample.texels[:0]))  # they are counted, and take memory
        self._halves = halves
        self.escaped = (halves[0].escaped + halves[1].escaped) / 2
        self.hits = hits[0] + hits[1]

    def table(self) -> "LinearOperator":
        """The table (S, S) of the first round, which maps the radiosity of surfels to the light that they receive."""
        parts = [
            scipy.sparse.linalg.aslinearoperator(table) for half in self._halves for table in (half.near, half.far)
        ]
        return (parts[0] + parts[1] + parts[2] + parts[3]) * 0.5

    def met(self) -> Floats:
        """The share (S,) of the rays of the first round that ended at a surfel or a lamp."""
        shares = [table.sum(1) for half in self._halves for table in (half.near, half.far)]
        return np.asarray(sum(shares)).ravel() / 2

    def sky_lx(self) -> Floats:
        """The illuminance (K, S) by each sky via mirrors, from the first round."""
        return (self._halves[0].sky + self._halves[1].sky) / 2

    def first_light(self, smoothing: Smoothing, radiosity: Floats) -> Floats:
        """The light (S, C) from the radiosity (S, C) of surfels by the first round alone."""
        near = sum(half.near @ radiosity for half in self._halves)
        far = sum(half.far @ radiosity for half in self._halves)
        return np.asarray(near + smoothing.averaged(far)) / 2

    def refined(
        self,
        smoothing: Smoothing,
        *,
        radiosity: Floats,
        luminance: Floats,
        sky_weights: Floats,
        direct: Floats,
        by_mirrors: Floats,
        noise: float,
        done: Callable[[float], object] | None = None,
    ) -> Gathered:
        """The gathered light after further rays from all surfels whose relative standard error exceeds `noise`.

        `radiosity` (S, C) is that of surfels in channels, `luminance` (C,) the weight of each channel.
        `direct` (S,) and `by_mirrors` (2, S), from two sets of photons, are luminances of all lights together.
        `sky_weights` (K,) is the luminance of the colour of each sky.
        """
        other_light = smoothing.blended(direct + by_mirrors.mean(0))
        totals = _totals_of(self._halves, radiosity)
        self._halves = []
        while True:
            stop.check()
            near_halves, far_halves = totals.luminance_halves(luminance, sky_weights)
            standard_error = _noise(smoothing, near_halves, far_halves, other_light)
            is_noisy = (standard_error > noise) & (totals.rounds < MOST_ROUNDS)
            noisy = np.flatnonzero(is_noisy)
            if len(noisy) <= FEWEST * len(self._middles):
                break
            round_count = self._double_rounds(totals, noisy, radiosity)
            if done:
                done(np.log2(round_count) / np.log2(2 * MOST_ROUNDS))

        # The noise of photons is added to that of rays.
        photon_noise = smoothing.blended((by_mirrors[0] - by_mirrors[1]) / 2)
        photon_variance = smoothing.averaged(photon_noise**2)
        light = _relative_to(smoothing.blended((near_halves + far_halves).mean(0)) + other_light)
        standard_error = np.sqrt(standard_error**2 + photon_variance / light**2)
        near_lx, far_lx, sky_lx = totals.means()
        return Gathered(
            (near_lx + smoothing.averaged(far_lx)).astype(np.float32),
            smoothing.averaged(sky_lx.T).T,
            standard_error,
        )

    def _double_rounds(self, totals: "RayTotals", rows: Rows, radiosity: Floats) -> int:
        """Double the number of rounds of the surfels at rows (N,). Returns the largest number of rounds after that."""
        round_count = int(totals.rounds[rows].max())
        middles = self._middles.take(rows)
        for repeat in range(round_count):
            for half in (0, 1):
                pass_index = 2 * (round_count + repeat) + half
                near, far, sky = self._gatherer.light(middles, radiosity, side=self._side, pass_index=pass_index)
                totals.near[half, rows] += near
                totals.far[half, rows] += far
                totals.sky[half][:, rows] += sky
        totals.rounds[rows] += round_count
        return 2 * round_count


@dataclass(frozen=True, slots=True)
class RayTotals:
    """The sums, over the rounds of rays, of the light that surfels receive. The two halves of all rays are separate.

    `near` and `far` (2, S, C) are the light from near and far surfels in C channels.
    `sky` (2, K, S) is the light of K skies.
    `rounds` (S,) is the number of rounds of each surfel.
    """

    near: Floats
    far: Floats
    sky: Floats
    rounds: Rows

    def luminance_halves(self, luminance: Floats, sky_weights: Floats) -> tuple[Floats, Floats]:
        """The mean near and far light (2, S) by each half of the rays.

        Channels are weighted by `luminance` (C,), and skies by `sky_weights` (K,).
        """
        # Not by `@`: the sums of BLAS round differently with another number of threads.
        near = np.einsum("hsc,c->hs", self.near, luminance)
        far = np.einsum("hsc,c->hs", self.far, luminance)
        far_sky = np.einsum("k,hks->hs", sky_weights, self.sky)
        return near / self.rounds, (far + far_sky) / self.rounds

    def means(self) -> tuple[Floats, Floats, Floats]:
        """The mean light from near and far surfels (S, C), and of the skies (K, S)."""
        near_lx = self.near.mean(0) / self.rounds[:, None]
        far_lx = self.far.mean(0) / self.rounds[:, None]
        sky_lx = self.sky.mean(0) / self.rounds
        return near_lx, far_lx, sky_lx


def _totals_of(halves: Sequence[Sample], radiosity: Floats) -> RayTotals:
    """The light by the first round of rays, given its two halves and the radiosity (S, C) of surfels."""
    near = np.stack([half.near @ radiosity for half in halves])
    far = np.stack([half.far @ radiosity for half in halves])
    sky = np.stack([half.sky for half in halves])
    return RayTotals(near, far, sky, rounds=np.ones(near.shape[1], np.int64))


def _relative_to(light: Floats) -> Floats:
    """The light (S,) that noise is relative to: the given light, or a minimum in dark places."""
    mean = float(light.mean()) if len(light) else 0.0
    darkest = max(DARK * mean, FAINTEST)
    return np.asarray(np.maximum(light, darkest))


def _noise(
    smoothing: Smoothing,
    near_halves: Floats,
    far_halves: Floats,
    other_light: Floats,
) -> Floats:
    """The standard error (S,) of the light that is shown at surfels, relative to all light.

    It is estimated from the two halves (2, S) of near light and of far light, both smoothed as they are shown. The
    squared difference is averaged over neighbours, because two values give a poor estimate.
    """
    shown_halves = [
        smoothing.blended(near + smoothing.averaged(far)) for near, far in zip(near_halves, far_halves, strict=True)
    ]
    light = _relative_to((shown_halves[0] + shown_halves[1]) / 2 + other_light)
    variance = ((shown_halves[0] - shown_halves[1]) / 2) ** 2
    for _ in range(VARIANCE_SMOOTHINGS):
        variance = smoothing.averaged(variance)
    return np.asarray(np.sqrt(variance) / light)
