"""The stationary part of a scene: the points at which its light is computed."""

from dataclasses import dataclass

import numpy as np

from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.array_types import Floats, Indices, Mask
from vobench.rendering.atlas import Atlas
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.face_parts import FaceParts
from vobench.rendering.geometry import are_panes, face_materials
from vobench.rendering.key_time import key_times_ns
from vobench.rendering.sun_tiles import sunlit_parts
from vobench.rendering.texel import Texels, texel_areas_m2, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.visibility import Visibility
from vobench.scene.light import Sun
from vobench.scene.scene import Scene, triangles
from vobench.scene.triangles import Triangles

MOVER_COARSER = 2  # the factor of the distance between samples on movers
SUNLIT_FINER = 2  # the divisor of this distance near shadows of the sun, whose penumbra is 1 cm per metre of distance
SAMPLES = 4_000_000  # the largest number of samples if no distance is requested, for a bake of some minutes


@dataclass(frozen=True, slots=True)
class StaticScene:
    """The stationary part of a scene: the faces that rays can hit, and the points whose light is computed.

    `cells` (P,) is the surfel of each point.
    `open_sky` (P,) is whether the sky may be visible from a point without a pane in front of it.
    """

    faces: Triangles
    visibility: Visibility
    atlas: Atlas
    points: Texels
    layout: TexelLayout
    cells: Indices
    open_sky: Mask


def bodies(scene: Scene, faces: Triangles) -> Mask:
    """Whether each face (F,) has a body, and therefore shows light."""
    materials = face_materials(faces, scene.materials)
    is_body = [material is not None and material.kind == "body" for material in materials]
    return np.array(is_body, bool)[faces.thing]


def sampled_faces(scene: Scene, settings: BakeSettings) -> tuple[FaceParts, Triangles, Array]:
    """The parts of a scene's faces, the table (T,) of these parts, and the distance (T,) in m between samples on each.

    Faces are divided so that samples are dense only near the edges of shadows of the sun.
    """
    faces = triangles(scene)
    directions = []
    for light in scene.lights:
        if isinstance(light, Sun):
            directions += [light.direction(t_ns) for t_ns in key_times_ns(light)]
    is_static = faces.mover < 0
    parts, is_fine = sunlit_parts(
        faces,
        is_receiver=bodies(scene, faces) & is_static,
        is_opaque=is_static & ~are_panes(faces, scene.materials),
        sun_directions=directions,
        spacing_m=_requested_spacing_m(faces, settings),
    )
    parted = parts.of(faces)
    return parts, parted, spacings_m(scene, parted, settings, is_fine)


def _requested_spacing_m(faces: Triangles, settings: BakeSettings) -> Array:
    """The distance (F,) between samples on each face: the one that its thing requests, or that of the settings."""
    by_thing_m = [thing.spacing_m or settings.spacing_m for thing in faces.things]
    return np.array(by_thing_m)[faces.thing]


def spacings_m(scene: Scene, faces: Triangles, settings: BakeSettings, is_fine: Mask) -> Array:
    """The distance (F,) in m between samples on each face. It is smaller on fine faces (F,) and larger on movers.

    On the faces of things that request no distance, it grows with the size of the scene, so that the number of samples
    is at most SAMPLES.
    """
    static_factor = np.where(is_fine, 1 / SUNLIT_FINER, 1.0)
    factor = np.where(faces.mover < 0, static_factor, MOVER_COARSER)
    spacing_m = _requested_spacing_m(faces, settings) * factor

    has_request = np.array([thing.spacing_m is not None for thing in faces.things])
    is_free = bodies(scene, faces) & ~has_request[faces.thing]
    sample_count = (areas_m2(faces.corners_m[is_free]) / spacing_m[is_free] ** 2).sum()
    growth = max(1.0, float(np.sqrt(sample_count / SAMPLES)))
    return np.asarray(spacing_m * np.where(is_free, growth, 1.0))


def static_points(
    scene: Scene,
    faces: Triangles,
    atlas: Atlas,
    seed: int,
) -> tuple[Visibility, Texels, TexelLayout, Floats]:
    """The stationary faces, the points on them, their layout, and the area (P,) in m² that each point represents."""
    is_static = faces.mover < 0
    visibility = Visibility(faces, scene.materials, np.flatnonzero(is_static))
    owner = owners(atlas)
    points, layout = texels(faces, scene.materials, atlas, owner, among=is_static, seed=seed, visibility=visibility)
    return visibility, points, layout, texel_areas_m2(faces, atlas, owner, is_static)[points.index]


def static_scene(baked: BakedScene) -> StaticScene:
    """The stationary part of a baked scene, recomputed."""
    visibility, points, layout, _ = static_points(baked.scene, baked.faces, baked.atlas, baked.settings.seed)
    cells = baked.patches.surfel_of[points.index]
    open_sky = np.ones(len(points), bool)
    return StaticScene(baked.faces, visibility, baked.atlas, points, layout, cells, open_sky)
