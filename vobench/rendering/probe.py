"""The room probe: a picture of everything around one place, which glossy surfaces show (a corrected cube map)."""

from collections.abc import Callable
from dataclasses import dataclass

import cv2
import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.array_types import Indices, Mask
from vobench.rendering.cube_map import PrefilteredCubeMap
from vobench.rendering.embree import TriangleCaster
from vobench.rendering.geometry import FAR_M
from vobench.rendering.renderer import Radiance
from vobench.rendering.view import NEAR_M
from vobench.scene.material import LUMINANCE, Material

PROBE_MOST = 0.4  # roughness above which what is mirrored looks like what lights the place
FADE = 0.1  # the width of the range of roughness below PROBE_MOST in which the share of the probe decreases to 0
SIZE_PX = 256
CAMERA = Pinhole(SIZE_PX, SIZE_PX, SIZE_PX / 2, SIZE_PX / 2, (SIZE_PX - 1) / 2, (SIZE_PX - 1) / 2)
LEVELS = 6
ROUGH_LEVEL = 4  # the first level without the area lights, which have glints in surfaces as rough as that
# Rows: the right, down and ahead axes of OpenGL's six faces, which show the world as a mirror does.
FACES = np.array(
    [
        [[0, 0, -1], [0, -1, 0], [1, 0, 0]],
        [[0, 0, 1], [0, -1, 0], [-1, 0, 0]],
        [[1, 0, 0], [0, 0, 1], [0, 1, 0]],
        [[1, 0, 0], [0, 0, -1], [0, -1, 0]],
        [[1, 0, 0], [0, -1, 0], [0, 0, 1]],
        [[-1, 0, 0], [0, -1, 0], [0, 0, -1]],
    ],
    float,
)
SAME_DEPTH = 0.01  # the share of a distance by which the depth of a lamp and of what hides it differ at least
WALL = 0.9  # the share of a face's pixels that are nearer than the wall there


@dataclass(frozen=True, slots=True)
class Probe:
    """The luminance around a place as a cube map, and the box of the room that it shows.

    texture: its levels are blurred for increasing roughness. low_m, high_m (3,): the bounds of the room. light (4,):
    the irradiance over π at the place is light[:3] · normal + light[3]. ambient_cd_m2 (3,): the mean luminance of the
    scene in the light in which the probe was drawn.
    """

    texture: PrefilteredCubeMap
    centre_m: Array
    low_m: Array
    high_m: Array
    light: Array
    ambient_cd_m2: Array


def room_probe(
    draw: Callable[[Pinhole, Array], tuple[Radiance, Radiance]],
    corners_m: Array,
    lamp_faces: Indices,
    ambient_cd_m2: Array,
) -> Probe:
    """The probe of a scene of faces (F, 3, 3). `draw` returns the picture (H, W, 3) and depth (H, W) of a camera.

    lamp_faces (L,): those of area lights that have glints.
    """
    centre_m = _free_place(corners_m)
    lamps = TriangleCaster(corners_m, lamp_faces, robust=True)
    rays = CAMERA.rays(pixel_grid(CAMERA)).reshape(-1, 3)
    along_axis = rays / rays[:, 2:]
    pictures = []
    pictures_without_lamps = []
    wall_distances_m = []
    for right, down, ahead in FACES:
        R_world_camera = np.stack([-right, down, ahead], 1)
        picture, reversed_depth = draw(CAMERA, se3.transform(R_world_camera, centre_m))
        farthest_m = float(((corners_m - centre_m) @ ahead).max())
        distance_m = np.where(reversed_depth > 0, NEAR_M / np.maximum(reversed_depth, 1e-9), farthest_m)
        pictures.append(picture[:, ::-1])
        if len(lamp_faces):
            is_lamp = _shows_lamp(lamps, centre_m, along_axis @ R_world_camera.T, distance_m)
            pictures_without_lamps.append(np.where(is_lamp[..., None], 0, picture)[:, ::-1])
        wall_distances_m.append(np.quantile(distance_m, WALL))
    roughness = [roughness_of(level) for level in range(LEVELS)]
    # Without lamps that have glints, all levels show the same pictures.
    distinct = [pictures, pictures_without_lamps] if len(lamp_faces) else [pictures]
    shown = [0] * ROUGH_LEVEL + [len(distinct) - 1] * (LEVELS - ROUGH_LEVEL)
    return Probe(
        texture=PrefilteredCubeMap(distinct, shown, FACES, roughness),
        centre_m=centre_m,
        low_m=centre_m - wall_distances_m[1::2],
        high_m=centre_m + wall_distances_m[::2],
        light=_irradiance(np.array(pictures)),
        ambient_cd_m2=ambient_cd_m2,
    )


def _shows_lamp(lamps: TriangleCaster, centre_m: Array, along_axis: Array, distance_m: Array) -> Mask:
    """Which pixels (H, W) show a lamp or are beside one that does.

    `along_axis` (H·W, 3) are the directions of pixels in the world, with a component of 1 along the axis of the camera.
    `distance_m` (H, W) is how far along the axis is what they show.
    """
    origins_m = np.broadcast_to(centre_m, along_axis.shape)
    lamp_m = lamps.hits(origins_m, along_axis, FAR_M).distance.reshape(distance_m.shape)
    is_lamp = lamp_m < distance_m * (1 + SAME_DEPTH)
    return cv2.dilate(is_lamp.astype(np.uint8), np.ones((3, 3), np.uint8)) > 0


def level_of(roughness: float) -> float:
    """The level of the cube map that is blurred by a roughness (GGX alpha)."""
    octaves = np.log2(max(roughness, 1e-6) / PROBE_MOST)
    return float(np.clip(LEVELS - 1 + octaves, 0, LEVELS - 1))


def roughness_of(level: int) -> float:
    """The roughness that a level of the cube map is blurred by."""
    return float(PROBE_MOST * 2.0 ** (level - LEVELS + 1)) if level else 0.0


def probe_share(material: Material) -> float:
    """The share of a surface's reflections that is read from the probe; 0 for a roughness of PROBE_MOST or more."""
    if material.kind != "body":
        return 1.0
    margin = PROBE_MOST - material.roughness
    return float(np.clip(margin / FADE, 0, 1))


def area_glint_share(material: Material) -> float:
    """The share of the glints of area lights that a surface shows; their other share is in the probe that it shows."""
    return float(np.clip(level_of(material.roughness) - (ROUGH_LEVEL - 1), 0, 1))


CLEAR_M = 0.5  # the distance of the probe from the nearest face above which more is no better
DISTANCE_COST_M = 0.1  # the clearance that outweighs a distance from the centre of the size of the scene


def _free_place(corners_m: Array) -> Array:
    """A place (3,) near the centre of faces (F, 3, 3) that is at some distance from all of them."""
    low_m = corners_m.min((0, 1))
    high_m = corners_m.max((0, 1))
    middle_m = (low_m + high_m) / 2
    size_m = high_m - low_m
    face_low_m = corners_m.min(1)
    face_high_m = corners_m.max(1)
    steps = np.linspace(-0.3, 0.3, 7)
    grid = np.meshgrid(steps, steps, steps / 2, indexing="ij")
    offsets = np.stack(grid, -1).reshape(-1, 3)

    distance = np.linalg.norm(offsets, axis=1).round(9)
    best_value = -np.inf
    best_offset = offsets[0]
    # From the centre outwards, until no place that is farther out can be better.
    for nth in np.argsort(distance, kind="stable"):
        offset = offsets[nth]
        most = CLEAR_M - DISTANCE_COST_M * distance[nth]
        if best_value >= most:
            break
        place_m = middle_m + offset * size_m
        outside_m = np.maximum(np.maximum(face_low_m - place_m, place_m - face_high_m), 0)
        clear_m = np.linalg.norm(outside_m, axis=1).min()
        value = min(clear_m - CLEAR_M, 0) + most
        if value > best_value:
            best_value = value
            best_offset = offset
    return np.asarray(middle_m + best_offset * size_m)


def _irradiance(pictures: Array) -> Array:
    """Coefficients (4,) of the irradiance over π from the surroundings (6, N, N, 3), to first order in the normal."""
    places = (np.arange(SIZE_PX) + 0.5) / SIZE_PX * 2 - 1
    vectors = np.stack([*np.meshgrid(places, places), np.ones((SIZE_PX, SIZE_PX))], -1)
    distance = np.linalg.norm(vectors, axis=-1)
    total = 6 * (distance**-3).sum()  # solid angle of all pixels, in units of one at distance 1
    weighted = pictures @ LUMINANCE / distance**3 / total
    directions = (vectors / distance[..., None]) @ FACES[:, None]
    gradient = 2 * np.einsum("fij,fijk->k", weighted, directions)
    return np.array([*gradient, weighted.sum()])
