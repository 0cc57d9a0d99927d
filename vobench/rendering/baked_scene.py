"""A scene with its light, as a bake computes it, and the settings of a bake."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge

from vobench.rendering.array_types import Floats, Indices
from vobench.rendering.atlas import Atlas
from vobench.rendering.face_parts import FaceParts
from vobench.scene.scene import Scene
from vobench.scene.triangles import Triangles
from vobench.setting import Positive, settings

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

INDIRECT_RAYS = 72  # from a surfel at first, by default


@settings(kw_only=False)
class BakeSettings:
    """How finely light is sampled. Numbers of rays are rounded to squares, so that rays can be stratified.

    `spacing_m` is the distance between samples of direct light.
    `light_rays` is the number of rays from a sample to a lamp of medium width that is partly hidden.
    `indirect_spacing_m` is the distance between surfels.
    `indirect_rays` is the number of rays from each surfel in the first round. If the relative standard error of its
    light is above `light_noise`, further rays follow, up to 8 times as many.
    `bounces` is the largest number of bounces. Fewer are computed if further ones add nothing.
    """

    spacing_m: Positive = 0.025
    light_rays: Annotated[int, Ge(1)] = 16
    indirect_spacing_m: Positive = 0.1
    indirect_rays: Annotated[int, Ge(0)] = INDIRECT_RAYS
    bounces: Annotated[int, Ge(0)] = 64
    seed: Annotated[int, Ge(0)] = 0
    light_noise: Positive = 0.02


@dataclass(frozen=True, slots=True)
class SunTrack:
    """The indirect light of a moving sun.

    `light` is its index among the lights. `bounced` (K, S, 3) is its light at increasing `times_ns` (K,).
    """

    light: int
    times_ns: tuple[float, ...]
    bounced: Floats


@dataclass(frozen=True, slots=True)
class Patches:
    """The S surfels of a light map, and the light that leaves them.

    `surfel_of` (H·W,) is the surfel of each texel, -1 for none.
    `reflectance` (S, 3) and `area_m2` (S,) are their properties.
    `radiosity` (L, S, 3) in lm/m² is due to each light alone, if the light is white.
    """

    surfel_of: Indices
    reflectance: Floats
    area_m2: Floats
    radiosity: Floats


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: everything that is needed to render a picture.

    `parts` and `faces` (T,) are the parts of the scene's faces, and their table. The parts of a face differ in the
    distance between samples of light.
    `atlas` has the places of these faces on the light map.
    `direct` (L, H, W) is the direct light of each light alone, if it is white and at level 1: the illuminance in lx,
    under a coat only the light that enters it. On a lamp it is π times the luminance.
    `bounced` (L, S, 3) is the indirect illuminance of surfels in lx. `spread` (H·W, S) interpolates it on the map.
    `patches` are the surfels.
    `tracks` are the indirect light of moving suns. In `direct` and `bounced`, they are at their first instant.
    `light_noise` is the relative standard error of the light due to random rays: the root mean square over surfaces.
    """

    scene: Scene
    parts: FaceParts
    faces: Triangles
    atlas: Atlas
    direct: Floats
    bounced: Floats
    spread: "csr_matrix"
    patches: Patches
    settings: BakeSettings = field(default_factory=BakeSettings)
    tracks: tuple[SunTrack, ...] = ()
    light_noise: float = 0.0

    @property
    def light_uv(self) -> Floats:
        """The places (T, 3, 2) of the corners of faces on the map, in [0, 1]."""
        return self.atlas.light_uv
