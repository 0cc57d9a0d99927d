"""The light on every face over an interval, and the mean luminance of a scene."""

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

SUN_TURN_RAD = 1e-4  # a moving sun counts as still within less than a fiftieth of its disc
CACHED = 16  # maps and moments: enough for the strips of a stereo pair


class AmbientLight:
    """Mean over the area of a scene's stationary bodies, in whatever light.

    Lamps and the sky do not count: few directions lead there, and in all others their share would be too bright.
    """

    def __init__(self, baked: BakedScene) -> None:
        patches = baked.patches
        # Counted from -1, the texels of no surfel.
        surfel_count = len(patches.area_m2)
        texel_count = np.bincount(patches.surfel_of + 1, minlength=surfel_count + 1)[1:]
        total_m2 = max(patches.area_m2.sum(), 1e-12)
        texel_share = patches.area_m2 / np.maximum(texel_count, 1) / np.pi / total_m2
        surfel_weights = texel_share[:, None] * patches.reflectance
        with_none = np.append(surfel_weights, np.zeros((1, 3)), 0)  # the last one for the surfel -1
        weights = with_none.astype(np.float32)
        self._weights = weights[patches.surfel_of].reshape(*baked.direct.shape[1:], 3)
        self._light = self._weights
        self._mean_cd_m2 = np.zeros(3)

    def cd_m2(self, light: Floats) -> Array:
        """The mean (3,) under a map of light (H, W, 3); the very array of the last call costs nothing."""
        if light is not self._light:
            # No dot product, whose order of adding up depends on the number of threads.
            self._light = light
            self._mean_cd_m2 = np.sum(self._weights * light, axis=(0, 1), dtype=np.float64)
        return self._mean_cd_m2


T = TypeVar("T")


def _cached(
    cache: OrderedDict[Hashable, T],
    key: Hashable,
    compute: Callable[[], T],
) -> T:
    """The value of a key among the CACHED ones that were asked for last."""
    if key not in cache:
        cache[key] = compute()
    cache.move_to_end(key)
    if len(cache) > CACHED:
        cache.popitem(last=False)
    return cache[key]


class Illumination:
    """A baked scene's light at any time. Steady light costs nothing; see docs/rendering.md for the rest.

    A light counts with its mean over the interval; movers and a moving sun are where they are at its middle.
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
        """Map (H, W, 3) float32 of linear RGB without movers: illuminance in lux, pi times their luminance on lamps.

        The mean from start_ns to end_ns; the very array of an earlier call where nothing differs.
        """
        levels, suns_ns = self._now(start_ns, end_ns)
        if not self._varying and not self._tracks:
            return self._steady
        return _cached(self._maps, (levels, suns_ns), lambda: self._map(levels, suns_ns))

    def lights_at(self, start_ns: int, end_ns: int) -> tuple[Floats, tuple[float, ...]]:
        """The colour of each light times its level (L, 3), and the instant of each sun that moves."""
        levels, suns_ns = self._now(start_ns, end_ns)
        colours = np.array([light.colour for light in self._lights], np.float32).reshape(-1, 3)
        return colours * np.array(levels, np.float32)[:, None], suns_ns

    def _now(
        self,
        start_ns: int,
        end_ns: int,
    ) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The level of each light, and the instant of each sun that moves."""
        middle_ns = (start_ns + end_ns) / 2
        levels = tuple(light.level.mean(start_ns, end_ns) for light in self._lights)
        suns_ns = tuple(_stepped_ns(light, middle_ns) for light in self._lights)
        return levels, suns_ns

    def _map(
        self,
        levels: tuple[float, ...],
        suns_ns: tuple[float, ...],
    ) -> Floats:
        total = self._steady.copy()
        if self._varying:
            total += self._sum({index: levels[index] for index in self._varying})
        for index in self._tracks:
            total += np.float32(levels[index]) * self._sun(index, suns_ns[index])
        return total

    def _sum(self, levels: dict[int, float]) -> Floats:
        """The map of lights, by their index, at levels."""
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
        """A moving sun's map at an instant: direct light by rays, the rest between the baked ones."""

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
    """When a moving sun last took a step of SUN_TURN_RAD, so that it need not be traced for every picture; else 0."""
    if not isinstance(light, Sun) or not light.moves:
        return 0.0
    times_ns = NS_PER_S * np.array(light.times_s)
    travel_rad = travelled_rad(light)
    stepped_rad = SUN_TURN_RAD * np.rint(np.interp(t_ns, times_ns, travel_rad) / SUN_TURN_RAD)
    return float(np.interp(stepped_rad, travel_rad, times_ns))


def _between(track: SunTrack, t_ns: float) -> Floats:
    """Indirect light of surfels (S, 3) at an instant, straight lines between the baked ones."""
    last = len(track.times_ns) - 1
    after = int(np.clip(np.searchsorted(track.times_ns, t_ns), 1, last))
    start_ns = track.times_ns[after - 1]
    end_ns = track.times_ns[after]
    share = np.float32((t_ns - start_ns) / (end_ns - start_ns))
    start = track.bounced[after - 1]
    end = track.bounced[after]
    return np.asarray((1 - share) * start + share * end)
