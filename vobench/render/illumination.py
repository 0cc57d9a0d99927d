"""The light on every surface over an interval, the sky behind it, and the mean luminance of a scene."""

from collections import OrderedDict
from collections.abc import Callable, Hashable, Sequence
from typing import TypeVar

import numpy as np

from vobench.geometry.se3 import Array
from vobench.render.bake import BakedScene, SunTrack, direct_layer, placed, static_scene, wandered_rad
from vobench.render.geometry import inventory
from vobench.render.lightmap import Scales
from vobench.render.mover_light import MoverLight, MoverLightAt
from vobench.scene.light import NS_PER_S, SKIES, Light, Sky, Steady, Sun
from vobench.scene.material import Map


class AmbientLight:
    """Mean over the area of a scene's textured surfaces, in whatever light.

    Lamps and the sky do not count: few directions lead there, and in all others their share would be too bright.
    """

    def __init__(self, baked: BakedScene) -> None:
        things, charts = inventory(baked.scene), baked.atlas.charts
        albedo = {name: float(tile.mean()) for name, tile in baked.albedo.items()}
        self._weights = np.zeros(baked.light.shape[1:], np.float32)
        area_m2 = 0.0
        for surface, panel, chart in zip(things.surfaces, things.panel, charts, strict=True):
            if panel < 0 and surface.material in albedo:
                own_m2 = float(np.prod(surface.size_m))
                self._weights[chart.window] = albedo[surface.material] / np.pi * own_m2 / (chart.rows * chart.columns)
                area_m2 += own_m2
        self._weights /= max(area_m2, 1e-12)
        self._light, self._mean_cd_m2 = self._weights, 0.0

    def cd_m2(self, light: Map) -> float:
        """The mean under a map of light (H, W); the very array of the last call costs nothing."""
        if light is not self._light:
            # No dot product, whose order of adding up hangs on the number of threads.
            self._light, self._mean_cd_m2 = light, float(np.sum(self._weights * light, dtype=np.float64))
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
        self._baked, self._lights = baked, baked.scene.lights
        self._tracks = {track.light: track for track in baked.tracks}
        fixed = [i for i in range(len(self._lights)) if i not in self._tracks]
        steady = [i for i in fixed if isinstance(self._lights[i].level, Steady)]
        self._varying = [i for i in fixed if i not in steady]
        self._steady = np.zeros(baked.light.shape[1:], np.float32)
        self._add(self._steady, {i: self._lights[i].level.mean(0, 0) for i in steady})
        if self._tracks or baked.scene.movers:
            self._still = static_scene(baked.scene, baked.atlas, seed=baked.settings.seed)
        self._movers = MoverLight(baked, self._still) if baked.scene.movers else None
        self._maps: OrderedDict[Hashable, Map] = OrderedDict()
        self._moments: OrderedDict[Hashable, MoverLightAt] = OrderedDict()
        self._suns: OrderedDict[Hashable, Map] = OrderedDict()

    def at(self, start_ns: int, end_ns: int) -> Map:
        """Map (H, W): the mean from start_ns to end_ns. The very array of an earlier call where nothing differs."""
        levels = tuple(light.level.mean(start_ns, end_ns) for light in self._lights)
        amid_ns = (start_ns + end_ns) / 2
        suns = tuple(_stepped_ns(light, amid_ns) for light in self._lights)
        poses = tuple(mover.path.pose(amid_ns).tobytes() for mover in self._baked.scene.movers)
        return _recent(self._maps, (levels, suns, poses), lambda: self._map(levels, suns, poses, amid_ns))

    def _map(self, levels: tuple[float, ...], suns: tuple[float, ...], poses: tuple[bytes, ...], amid_ns: float) -> Map:
        total = self._steady.copy()
        self._add(total, {i: levels[i] for i in self._varying})
        for index in self._tracks:
            total += np.float32(levels[index]) * self._sun(index, suns[index])
        if self._movers:
            movers = self._movers
            is_on = tuple(level > 0 for level in levels)
            moment = _recent(self._moments, (suns, poses, is_on), lambda: movers.at(amid_ns, suns, is_on))
            movers.add(moment, total, levels)
        return total

    def _add(self, total: Map, levels: dict[int, float]) -> None:
        for index, level in levels.items():
            total += np.float32(level) * self._baked.light[index]

    def _sun(self, index: int, t_ns: float) -> Map:
        """A moving sun's layer at an instant: straight light by rays, the rest between the baked ones."""

        def make() -> Map:
            scene, settings = self._baked.scene, self._baked.settings
            coarse = placed(scene, spacing_m=settings.indirect_spacing_m)
            around = Scales(self._still.atlas, coarse).refined(_between(self._tracks[index], t_ns)[None])[0]
            return np.asarray(direct_layer(scene, index, self._still, settings, t_ns=t_ns) + around)

        return _recent(self._suns, (index, t_ns), make)


def _stepped_ns(light: Light, t_ns: float) -> float:
    """When a moving sun last took a step of SUN_TURN_RAD, so that it need not be traced for every picture; else 0."""
    if not isinstance(light, Sun) or not light.moves:
        return 0.0
    times_ns, way_rad = NS_PER_S * np.array(light.times_s), wandered_rad(light)
    stepped_rad = SUN_TURN_RAD * np.rint(np.interp(t_ns, times_ns, way_rad) / SUN_TURN_RAD)
    return float(np.interp(stepped_rad, way_rad, times_ns))


def _between(track: SunTrack, t_ns: float) -> Map:
    """Indirect light (h, w) at an instant, straight lines between the baked ones."""
    after = int(np.clip(np.searchsorted(track.times_ns, t_ns), 1, len(track.times_ns) - 1))
    start, end = track.times_ns[after - 1 : after + 1]
    share = np.float32((t_ns - start) / (end - start))
    return np.asarray((1 - share) * track.bounced[after - 1] + share * track.bounced[after])
