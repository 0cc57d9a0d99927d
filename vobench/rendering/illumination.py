"""The light on every face over an interval, the sky behind it, and the mean luminance of a scene."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import numpy as np

from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Floats
from vobench.rendering.bake import BakedScene, SunTrack, direct_layer, direct_points, static_scene, wandered_rad
from vobench.rendering.mover_light import MoverLight, MoverLightAt, Views
from vobench.scene.light import NS_PER_S, SKIES, Light, Sky, Steady, Sun


class AmbientLight:
    """Mean over the area of a scene's bodies that stand still, in whatever light.

    Lamps and the sky do not count: few directions lead there, and in all others their share would be too bright.
    """

    def __init__(self, baked: BakedScene) -> None:
        patches = baked.patches
        shape = (*baked.direct.shape[1:], 3)
        texels = np.bincount(patches.surfel_of + 1, minlength=len(patches.area_m2) + 1)[1:]
        each = (patches.area_m2 / np.maximum(texels, 1) / np.pi / max(patches.area_m2.sum(), 1e-12))[:, None]
        weights = np.append(each * patches.reflectance, np.zeros((1, 3)), 0).astype(np.float32)
        self._weights = weights[patches.surfel_of].reshape(shape)
        self._light = self._weights
        self._mean_cd_m2 = np.zeros(3)

    def cd_m2(self, light: Floats) -> Array:
        """The mean (3,) under a map of light (H, W, 3); the very array of the last call costs nothing."""
        if light is not self._light:
            # No dot product, whose order of adding up hangs on the number of threads.
            self._light = light
            self._mean_cd_m2 = np.sum(self._weights * light, axis=(0, 1), dtype=np.float64)
        return self._mean_cd_m2


ZENITH = np.array([0.0, 0.0, 1.0])


class Background:
    """The skies among a scene's lights."""

    def __init__(self, lights: Sequence[Light]) -> None:
        self.skies = [light for light in lights if isinstance(light, Sky)]
        self._nominal = np.array([_coefficients(sky) for sky in self.skies]).reshape(-1, 3, 4)

    def coefficients(self, start_ns: int, end_ns: int) -> Array:
        """(S, 3, 4): `gradation`, `scatter` and `sun` of the shader, with the mean level over an interval."""
        now = self._nominal.copy()
        levels = [sky.level.mean(start_ns, end_ns) for sky in self.skies]
        now[:, 0, 2:] *= np.reshape(levels, (-1, 1))
        return now


def _coefficients(sky: Sky) -> Array:
    """Source: ISO 15469:2004, eqs 1 to 7; the scale follows from the luminance at the zenith."""
    a, b, c, d, e = SKIES[sky.kind]
    across = np.exp(d * np.pi / 2)
    chi = np.arccos(np.clip(ZENITH @ sky.sun_direction, -1, 1))
    relative = (1 + a * np.exp(b)) * (1 + c * (np.exp(d * chi) - across) + e * np.cos(chi) ** 2)
    zenith, ground = sky.luminance_cd_m2(np.stack([ZENITH, -ZENITH]))
    return np.array([[a, b, zenith / relative, ground], [c, d, e, across], [*sky.sun_direction, 0]])


SUN_TURN_RAD = 1e-4  # a moving sun counts as still within less than a fiftieth of its disc
KEPT = 16  # maps and moments: enough for the strips of a stereo pair

T = TypeVar("T")


def _recent(kept: OrderedDict[Hashable, T], key: Hashable, make: Callable[[], T]) -> T:
    if key not in kept:
        kept[key] = make()
    kept.move_to_end(key)
    if len(kept) > KEPT:
        kept.popitem(last=False)
    return kept[key]


class Illumination:
    """A baked scene's light at any time. What stays as it is costs nothing; see docs/rendering.md for the rest.

    A light counts with its mean over the interval; movers and a moving sun are where they are amid it.
    """

    def __init__(self, baked: BakedScene) -> None:
        self._baked = baked
        self._lights = baked.scene.lights
        self._tracks = {track.light: track for track in baked.tracks}
        fixed = [i for i in range(len(self._lights)) if i not in self._tracks]
        steady = [i for i in fixed if isinstance(self._lights[i].level, Steady)]
        self._varying = [i for i in fixed if i not in steady]
        self._steady = self._sum({i: self._lights[i].level.mean(0, 0) for i in steady})
        if self._tracks or baked.scene.movers:
            self._still = static_scene(baked)
        self._movers = MoverLight(baked, self._still) if baked.scene.movers else None
        self._maps: OrderedDict[Hashable, Floats] = OrderedDict()
        self._moments: OrderedDict[Hashable, MoverLightAt] = OrderedDict()
        self._suns: OrderedDict[Hashable, Floats] = OrderedDict()

    def at(self, start_ns: int, end_ns: int, views: Views | None = None) -> Floats:
        """Map (H, W, 3) float32 of linear RGB: illuminance in lux, pi times their luminance on lamps.

        The mean from start_ns to end_ns; the very array of an earlier call where nothing differs. Movers may have
        their shade where the views lead alone, everywhere without.
        """
        total = self.without_movers(start_ns, end_ns)
        if not self._movers:
            return total
        movers = self._movers
        (levels, suns) = self._now(start_ns, end_ns)
        amid_ns = (start_ns + end_ns) / 2
        is_on = tuple(level > 0 for level in levels)
        poses = tuple(mover.path.pose(amid_ns).tobytes() for mover in self._baked.scene.movers)
        moment = _recent(self._moments, (suns, poses, is_on), lambda: movers.at(amid_ns, suns, is_on))
        movers.shade(moment, views)
        return _recent(self._maps, (levels, suns, poses, len(moment.lost)), lambda: movers.add(moment, total, levels))

    def without_movers(self, start_ns: int, end_ns: int) -> Floats:
        """The same map as if there were no movers."""
        levels, suns = self._now(start_ns, end_ns)
        if not self._varying and not self._tracks:
            return self._steady
        return _recent(self._maps, (levels, suns), lambda: self._map(levels, suns))

    def _now(self, start_ns: int, end_ns: int) -> tuple[tuple[float, ...], tuple[float, ...]]:
        """The level of each light, and the instant of each sun that moves."""
        levels = tuple(light.level.mean(start_ns, end_ns) for light in self._lights)
        return levels, tuple(_stepped_ns(light, (start_ns + end_ns) / 2) for light in self._lights)

    def _map(self, levels: tuple[float, ...], suns: tuple[float, ...]) -> Floats:
        total = self._steady.copy()
        if self._varying:
            total += self._sum({i: levels[i] for i in self._varying})
        for index in self._tracks:
            total += np.float32(levels[index]) * self._sun(index, suns[index])
        return total

    def _sum(self, levels: dict[int, float]) -> Floats:
        """The map of some lights at levels."""
        baked = self._baked
        total = np.zeros((*baked.direct.shape[1:], 3), np.float32)
        around = np.zeros(baked.bounced.shape[1:], np.float32)
        for index, level in levels.items():
            colour = (level * np.array(self._lights[index].colour)).astype(np.float32)
            around += colour * baked.bounced[index]
            for channel in range(3):
                total[..., channel] += colour[channel] * baked.direct[index]
        total += (baked.spread @ around).reshape(total.shape)
        return total

    def _sun(self, index: int, t_ns: float) -> Floats:
        """A moving sun's map at an instant: straight light by rays, the rest between the baked ones."""

        def make() -> Floats:
            scene = self._baked.scene
            baked = self._baked
            light = direct_points(scene, index, self._still, baked.settings, t_ns=t_ns)
            straight = direct_layer(scene, index, self._still, light)[..., None]
            around = (baked.spread @ _between(self._tracks[index], t_ns)).reshape(*straight.shape[:2], 3)
            return np.asarray((straight + around) * np.array(self._lights[index].colour, np.float32))

        return _recent(self._suns, (index, t_ns), make)


def _stepped_ns(light: Light, t_ns: float) -> float:
    """When a moving sun last took a step of SUN_TURN_RAD, so that it need not be traced for every picture; else 0."""
    if not isinstance(light, Sun) or not light.moves:
        return 0.0
    times_ns = NS_PER_S * np.array(light.times_s)
    way_rad = wandered_rad(light)
    stepped_rad = SUN_TURN_RAD * np.rint(np.interp(t_ns, times_ns, way_rad) / SUN_TURN_RAD)
    return float(np.interp(stepped_rad, way_rad, times_ns))


def _between(track: SunTrack, t_ns: float) -> Floats:
    """Indirect light of surfels (S, 3) at an instant, straight lines between the baked ones."""
    after = int(np.clip(np.searchsorted(track.times_ns, t_ns), 1, len(track.times_ns) - 1))
    start, end = track.times_ns[after - 1 : after + 1]
    share = np.float32((t_ns - start) / (end - start))
    return np.asarray((1 - share) * track.bounced[after - 1] + share * track.bounced[after])
