"""The light map of a baked scene at any time, and the mean luminance of its surfaces."""

from collections import OrderedDict
from collections.abc import Callable, Hashable
from typing import TypeVar

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats
from vobench.rendering.bake import direct_layer, direct_points
from vobench.rendering.baked_scene import BakedScene, SunTrack
from vobench.rendering.key_time import travelled_rad
from vobench.rendering.static_scene import static_scene
from vobench.scene.light import Light, Steady, Sun
from vobench.trajectory.nanoseconds import NS_PER_S

SUN_TURN_RAD = 1e-4  # the angle of a step of a moving sun, less than a fiftieth of the diameter of its disc
CACHED = 16  # the number of cached light maps, which is enough for the strips of a stereo pair


class AmbientLight:
    """The mean luminance of the stationary bodies of a scene, weighted by area, under any light map.

    Lamps and the sky do not count: they are seen in few directions, and in all others the mean would be too bright.
    """

    def __init__(self, baked: BakedScene) -> None:
        patches = baked.patches
        # The texels of each surfel are counted; those without a surfel, which have -1, are left out.
        surfel_count = len(patches.area_m2)
        texel_count = np.bincount(patches.surfel_of + 1, minlength=surfel_count + 1)[1:]
        total_m2 = max(patches.area_m2.sum(), 1e-12)
        texel_share = patches.area_m2 / np.maximum(texel_count, 1) / np.pi / total_m2
        surfel_weights = texel_share[:, None] * patches.reflectance
        weights_or_zero = np.append(surfel_weights, [[0, 0, 0]], axis=0)  # row -1: texels without a surfel
        weights = weights_or_zero.astype(np.float32)
        self._weights = weights[patches.surfel_of].reshape(*baked.direct.shape[1:], 3)
        self._light = self._weights
        self._mean_cd_m2 = np.zeros(3)

    def cd_m2(self, light: Floats) -> Array:
        """The mean (3,) under a light map (H, W, 3). It is recomputed only for another array than in the last call."""
        if light is not self._light:
            # np.sum instead of a dot product, whose result depends on the number of threads.
            self._light = light
            self._mean_cd_m2 = np.sum(self._weights * light, axis=(0, 1), dtype=np.float64)
        return self._mean_cd_m2


T = TypeVar("T")


def _cached(
    cache: OrderedDict[Hashable, T],
    key: Hashable,
    compute: Callable[[], T],
) -> T:
    """The value of a key, computed unless it is one of the CACHED values that were used last."""
    if key not in cache:
        cache[key] = compute()
    cache.move_to_end(key)
    if len(cache) > CACHED:
        cache.popitem(last=False)
    return cache[key]


class Illumination:
    """The light map of a baked scene over an interval of time, without movers; see docs/rendering.md.

    A light counts with its mean level over the interval, and a moving sun is where it is at the middle of it.
    """

    def __init__(self, baked: BakedScene) -> None:
        self._baked = baked
        self._lights = baked.scene.lights
        self._tracks = {track.light: track for track in baked.tracks}
        steady = dict[int, float]()
        self._varying = list[int]()
        for index, light in enumerate(self._lights):
            if index in self._tracks:
                continue
            if isinstance(light.level, Steady):
                steady[index] = light.level.mean(0, 0)
            else:
                self._varying.append(index)
        self._steady = self._sum(steady)
        if self._tracks:
            self._static = static_scene(baked)
        self._maps: OrderedDict[Hashable, Floats] = OrderedDict()
        self._suns: OrderedDict[Hashable, Floats] = OrderedDict()

    def at(self, start_ns: int, end_ns: int) -> Floats:
        """The mean light map (H, W, 3) float32 of linear RGB from start_ns to end_ns, without movers.

        It has the illuminance in lx, and on lamps π times their luminance. If the light is the same as in a recent
        call, the same array is returned.
        """
        levels, suns_ns = self._now(start_ns, end_ns)
        if not self._varying and not self._tracks:
            return self._steady
        return _cached(self._maps, (levels, suns_ns), lambda: self._map(levels, suns_ns))

    def lights_at(self, start_ns: int, end_ns: int) -> tuple[Floats, tuple[float, ...]]:
        """The state of the L lights from start_ns to end_ns.

        Returns the colours (L, 3) times the levels, and the instant in ns of each moving sun. It is 0 for other lights.
        """
        levels, suns_ns = self._now(start_ns, end_ns)
        colours = np.array([light.colour for light in self._lights], np.float32).reshape(-1, 3)
        return colours * np.array(levels, np.float32)[:, None], suns_ns

    def _now(
        self,
        start_ns: int,
        end_ns: int,
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The level of each light, and the instant in ns of each moving sun. It is 0 for other lights."""
        middle_ns = (start_ns + end_ns) / 2
        levels = tuple(light.level.mean(start_ns, end_ns) for light in self._lights)
        suns_ns = tuple(_stepped_ns(light, middle_ns) for light in self._lights)
        return levels, suns_ns

    def _map(
        self,
        levels: tuple[float, ...],
        suns_ns: tuple[float, ...],
    ) -> Floats:
        """The light map (H, W, 3) for the levels and the instants in ns of `_now`."""
        total = self._steady.copy()
        if self._varying:
            total += self._sum({index: levels[index] for index in self._varying})
        for index in self._tracks:
            total += np.float32(levels[index]) * self._sun(index, suns_ns[index])
        return total

    def _sum(self, levels: dict[int, float]) -> Floats:
        """The light map (H, W, 3) of some lights. `levels` has the level of each of them by its index."""
        baked = self._baked
        total = np.zeros((*baked.direct.shape[1:], 3), np.float32)
        indirect = np.zeros(baked.bounced.shape[1:], np.float32)
        for index, level in levels.items():
            nominal_colour = np.array(self._lights[index].colour)
            colour = (level * nominal_colour).astype(np.float32)
            indirect += colour * baked.bounced[index]
            for channel in range(3):
                total[..., channel] += colour[channel] * baked.direct[index]
        total += (baked.spread @ indirect).reshape(total.shape)
        return total

    def _sun(self, index: int, t_ns: float) -> Floats:
        """The light map (H, W, 3) of a moving sun at an instant.

        Direct light is computed by casting rays. Indirect light is interpolated between baked instants.
        """

        def compute() -> Floats:
            baked = self._baked
            scene = baked.scene
            light = direct_points(scene, index, self._static, baked.settings, t_ns=t_ns)
            direct = direct_layer(scene, index, self._static, light)[..., None]
            indirect = baked.spread @ _between(self._tracks[index], t_ns)
            colour = np.array(self._lights[index].colour, np.float32)
            total = direct + indirect.reshape(*direct.shape[:2], 3)
            return np.asarray(total * colour)

        return _cached(self._suns, (index, t_ns), compute)


def _stepped_ns(light: Light, t_ns: float) -> float:
    """The instant in ns, rounded so that a moving sun turns in steps of SUN_TURN_RAD. It is 0 for other lights.

    A light map is computed for each step only.
    """
    if not isinstance(light, Sun) or not light.moves:
        return 0.0
    times_ns = NS_PER_S * np.array(light.times_s)
    travel_rad = travelled_rad(light)
    turned_rad = np.interp(t_ns, times_ns, travel_rad)
    stepped_rad = SUN_TURN_RAD * np.rint(turned_rad / SUN_TURN_RAD)
    return float(np.interp(stepped_rad, travel_rad, times_ns))


def _between(track: SunTrack, t_ns: float) -> Floats:
    """The indirect light (S, 3) of surfels at an instant, interpolated linearly between baked instants."""
    last = len(track.times_ns) - 1
    after = int(np.clip(np.searchsorted(track.times_ns, t_ns), 1, last))
    start_ns = track.times_ns[after - 1]
    end_ns = track.times_ns[after]
    share = np.float32((t_ns - start_ns) / (end_ns - start_ns))
    start = track.bounced[after - 1]
    end = track.bounced[after]
    return np.asarray((1 - share) * start + share * end)
