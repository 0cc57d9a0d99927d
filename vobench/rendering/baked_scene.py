"""A scene with its light, as a bake computes it, and the settings of a bake."""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated

from annotated_types import Ge

from vobench.rendering.array_types import Floats, Indices
from vobench.rendering.atlas import Atlas
from vobench.rendering.sun_tiles import FaceParts
from vobench.scene.scene import Scene
from vobench.scene.triangles import Triangles
from vobench.setting import Positive, settings

if TYPE_CHECKING:
    from scipy.sparse import csr_matrix

INDIRECT_RAYS = 72  # from a surfel at first, by default


@settings(kw_only=False)
class BakeSettings:
    """How finely light is sampled. Numbers of rays are rounded to squares, so that rays can be stratified.

    spacing_m: between samples of direct light. light_rays: from a sample to a lamp of medium width that is partly
    hidden. indirect_spacing_m: between surfels. indirect_rays: from each surfel at first; more follow from surfels
    whose light has a relative standard error above light_noise, up to 8 times as many. bounces: at most; they end where
    they add no more.
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
    """The indirect light (K, S, 3) of a moving sun at increasing times_ns (K,). light: its index among the lights."""

    light: int
    times_ns: tuple[float, ...]
    bounced: Floats


@dataclass(frozen=True, slots=True)
class Patches:
    """The surfels of a map, and the light that they send out.

    surfel_of (H·W,): the surfel of each texel, -1 for none. reflectance (S, 3). area_m2 (S,). radiosity (L, S, 3): in
    lm/m² under each light alone, if it is white.
    """

    surfel_of: Indices
    reflectance: Floats
    area_m2: Floats
    radiosity: Floats


@dataclass(frozen=True, slots=True)
class BakedScene:
    """A scene with its light: all that rendering a picture needs.

    parts and faces (T,): the parts of the scene's faces, and their table; parts differ in the distance of samples.
    atlas: the places of these faces on the light map.
    direct (L, H, W): what each light alone gives directly at level 1 if it is white: the illuminance in lx, under a
    coat the share that enters it; on a lamp π times its luminance.
    bounced (L, S, 3): what it gives surfels by bounces in lx. spread (H·W, S) interpolates that on the map.
    patches: the surfels.
    tracks: the indirect light of moving suns; their layers in `direct` and `bounced` are those of the first instant.
    light_noise: the relative standard error of the light due to random rays, root mean square over surfaces.
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
