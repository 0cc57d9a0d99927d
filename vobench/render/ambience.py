"""What stands in for the world in a mirror that is not followed: the mean luminance of all that scatters light."""

import numpy as np

from vobench.render.bake import BakedScene
from vobench.render.geometry import inventory
from vobench.scene.texture import Map


class Ambience:
    """Mean over the area of a scene's textured surfaces, in whatever light.

    Lamps and the sky do not count: few directions lead there, and in all others their share would be too bright.
    """

    def __init__(self, baked: BakedScene) -> None:
        things, patches = inventory(baked.scene), baked.layout.patches
        albedo = {name: float(tile.mean()) for name, tile in baked.albedo.items()}
        self._weights = np.zeros(baked.light.shape[1:], np.float32)
        area_m2 = 0.0
        for surface, panel, patch in zip(things.surfaces, things.panel, patches, strict=True):
            if panel < 0 and surface.material in albedo:
                own_m2 = float(np.prod(surface.size_m))
                self._weights[patch.window] = albedo[surface.material] / np.pi * own_m2 / (patch.rows * patch.columns)
                area_m2 += own_m2
        self._weights /= max(area_m2, 1e-12)
        self._light, self._mean_cd_m2 = self._weights, 0.0

    def cd_m2(self, light: Map) -> float:
        """The mean under a map of light (H, W); the very array of the last call costs nothing."""
        if light is not self._light:
            # No dot product, whose order of adding up hangs on the number of threads.
            self._light, self._mean_cd_m2 = light, float(np.sum(self._weights * light, dtype=np.float64))
        return self._mean_cd_m2
