"""What gloss shows of a scene: the room probe, a picture of all that is around one place, and glints of lamps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.cube_map import PrefilteredCubeMap
from vobench.rendering.renderer import Radiance
from vobench.rendering.uniform_block import MOST_GLINTS
from vobench.rendering.view import NEAR_M
from vobench.scene.light import Light, PointLight, SpotLight, Sun
from vobench.scene.material import LUMINANCE, Material

PROBE_MOST = 0.4  # roughness above which what is mirrored looks like what lights the place
FADE = 0.1  # the width of the range of roughness below PROBE_MOST in which the share of the probe decreases to 0
SIZE_PX = 256
CAMERA = Pinhole(SIZE_PX, SIZE_PX, SIZE_PX / 2, SIZE_PX / 2, (SIZE_PX - 1) / 2, (SIZE_PX - 1) / 2)
LEVELS = 6
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
WALL = 0.9  # the share of a face's pixels that are nearer than the wall there


@dataclass(frozen=True, slots=True)
class Probe:
    """Luminance around centre_m as a cube map, each level blurred by more roughness, and the room that it shows.

    low_m, high_m (3,): the room's bounds. light (4,): irradiance over π is the last plus the first three times the
    normal. ambient_cd_m2 (3,) is the scene's mean luminance in the light that it was drawn in.
    """

    texture: PrefilteredCubeMap
    centre_m: Array
    low_m: Array
    high_m: Array
    light: Array
    ambient_cd_m2: Array


def room_probe(
    draw: Callable[[Pinhole, Array], tuple[Radiance, Radiance]], corners_m: Array, ambient_cd_m2: Array
) -> Probe:
    """The probe of a scene of faces (F, 3, 3): `draw` gives a camera's picture (H, W, 3) and depth buffer (H, W)."""
    centre_m = _free_place(corners_m)
    pictures = []
    wall_distances_m = []
    for right, down, ahead in FACES:
        R_world_camera = np.stack([-right, down, ahead], 1)
        picture, reversed_depth = draw(CAMERA, se3.transform(R_world_camera, centre_m))
        pictures.append(picture[:, ::-1])
        farthest_m = float(((corners_m - centre_m) @ ahead).max())
        distance_m = np.where(reversed_depth > 0, NEAR_M / np.maximum(reversed_depth, 1e-9), farthest_m)
        wall_distances_m.append(np.quantile(distance_m, WALL))
    roughness = [roughness_of(level) for level in range(LEVELS)]
    return Probe(
        texture=PrefilteredCubeMap(pictures, FACES, roughness),
        centre_m=centre_m,
        low_m=centre_m - wall_distances_m[1::2],
        high_m=centre_m + wall_distances_m[::2],
        light=_irradiance(np.array(pictures)),
        ambient_cd_m2=ambient_cd_m2,
    )


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


CLEAR_M = 0.5  # from the probe to what is next to it
DISTANCE_COST_M = 0.1  # of clearance that a place as far from the middle as the scene is large must have more


def _free_place(corners_m: Array) -> Array:
    """A place (3,) near the middle of faces (F, 3, 3) with room around it."""
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
    # From the middle outwards, until what is farther out cannot be better.
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


EVERYWHERE_RAD = 10.0  # more than any angle to an axis
NO_AXIS = (0.0, 0.0, 0.0, 1.0)


def glints(
    lights: Sequence[Light],
    eye_m: Array,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The lamps (G, 3, 4) that no picture shows, including the sun: those with the highest illuminance at an eye (3,).

    Each: place and 1, or direction and 0; intensity or illuminance of three channels, and the angle at which a spot
    ends; the spot's direction, and 1 / the angle over which it fades.
    """
    bulbs = [light for light in lights if isinstance(light, PointLight | SpotLight | Sun)]
    rows = [_glint(light, start_ns, end_ns) for light in bulbs]
    if len(rows) > MOST_GLINTS:
        rows.sort(key=lambda glint: -_illuminance(glint, eye_m))
    return np.array(rows[:MOST_GLINTS]).reshape(-1, 3, 4)


def _illuminance(glint: Array, eye_m: Array) -> float:
    """How much a lamp (3, 4) shines on an eye (3,), in units of its own."""
    place, power, _ = glint
    is_near = place[3]  # 0 for a direction
    squared_m2 = np.sum((place[:3] - is_near * eye_m) ** 2)
    return float(power[:3].sum() / squared_m2)


def _glint(
    light: PointLight | SpotLight | Sun,
    start_ns: int,
    end_ns: int,
) -> Array:
    """The three rows of a lamp in `glints`."""
    level = light.level.mean(start_ns, end_ns) * np.array(light.colour)
    if isinstance(light, Sun):
        direction = light.direction((start_ns + end_ns) / 2)
        return np.array([[*direction, 0], [*light.illuminance_lx * level, EVERYWHERE_RAD], NO_AXIS])
    place = [*light.position_m, 1]
    if isinstance(light, PointLight):
        intensity_cd = light.power_lm / (4 * np.pi)
        return np.array([place, [*intensity_cd * level, EVERYWHERE_RAD], NO_AXIS])
    inner_rad, outer_rad = np.deg2rad([light.inner_deg, light.outer_deg])
    fade = 1 / max(outer_rad - inner_rad, 1e-9)
    return np.array([place, [*light.peak_cd * level, outer_rad], [*light.direction, fade]])
