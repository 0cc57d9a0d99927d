"""What gloss shows of a scene: the room probe, which is all that is seen around one place, and glints of lamps."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from vobench.geometry import se3
from vobench.geometry.camera import Pinhole
from vobench.geometry.se3 import Array
from vobench.rendering.opengl import CubeTexture
from vobench.rendering.renderer import Radiance
from vobench.rendering.uniform_block import MOST_GLINTS
from vobench.rendering.view import NEAR_M
from vobench.scene.light import Light, PointLight, SpotLight, Sun
from vobench.scene.material import LUMINANCE

PROBE_MOST = 0.4  # roughness above which what is mirrored looks like what lights the place
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

    texture: CubeTexture
    centre_m: Array
    low_m: Array
    high_m: Array
    light: Array
    ambient_cd_m2: Array


def room_probe(
    draw: Callable[[Pinhole, Array], tuple[Radiance, Radiance]], corners_m: Array, ambient_cd_m2: Array
) -> Probe:
    """The probe of a scene of faces (F, 3, 3): `draw` gives picture (H, W, 3) and nearness (H, W) of a camera."""
    centre_m = _amid(corners_m)
    pictures = []
    reach = []
    for right, down, ahead in FACES:
        picture, nearness = draw(CAMERA, se3.transform(np.stack([-right, down, ahead], 1), centre_m))
        pictures.append(picture[:, ::-1])
        beyond = float(((corners_m - centre_m) @ ahead).max())
        reach.append(np.quantile(np.where(nearness > 0, NEAR_M / np.maximum(nearness, 1e-9), beyond), WALL))
    return Probe(
        CubeTexture(pictures, FACES, [roughness_of(level) for level in range(LEVELS)]),
        centre_m,
        centre_m - reach[1::2],
        centre_m + reach[::2],
        _irradiance(np.array(pictures)),
        ambient_cd_m2,
    )


def level_of(roughness: float) -> float:
    """The level of the cube map that is blurred by a roughness (GGX alpha)."""
    return float(np.clip(LEVELS - 1 + np.log2(max(roughness, 1e-6) / PROBE_MOST), 0, LEVELS - 1))


def roughness_of(level: int) -> float:
    """The roughness that a level of the cube map is blurred by."""
    return float(PROBE_MOST * 2.0 ** (level - LEVELS + 1)) if level else 0.0


CLEAR_M = 0.5  # from the probe to what is next to it


def _amid(corners_m: Array) -> Array:
    """A place near the middle of faces (F, 3, 3) with room around it."""
    low = corners_m.min((0, 1))
    high = corners_m.max((0, 1))
    steps = np.linspace(-0.3, 0.3, 7)
    offsets = np.stack(np.meshgrid(steps, steps, steps / 2, indexing="ij"), -1).reshape(-1, 3)
    near = corners_m.min(1)
    far = corners_m.max(1)

    aside = np.linalg.norm(offsets, axis=1).round(9)
    best = -np.inf
    found = offsets[0]
    # From the middle outwards, until what is farther out cannot be better.
    for nth in np.argsort(aside, kind="stable"):
        offset = offsets[nth]
        most = CLEAR_M - 0.1 * aside[nth]
        if best >= most:
            break
        place = (low + high) / 2 + offset * (high - low)
        clear = np.linalg.norm(np.maximum(np.maximum(near - place, place - far), 0), axis=1).min()
        value = min(clear - CLEAR_M, 0) + most
        if value > best:
            best = value
            found = offset
    return np.asarray((low + high) / 2 + found * (high - low))


def _irradiance(pictures: Array) -> Array:
    """Coefficients (4,) of irradiance over π by what is around (6, N, N, 3), to first order in the normal."""
    at = (np.arange(SIZE_PX) + 0.5) / SIZE_PX * 2 - 1
    across = np.stack([*np.meshgrid(at, at), np.ones((SIZE_PX, SIZE_PX))], -1)
    distance = np.linalg.norm(across, axis=-1)
    weighted = pictures @ LUMINANCE / distance**3 / (6 * (distance**-3).sum())
    towards = (across / distance[..., None]) @ FACES[:, None]
    return np.array([*2 * np.einsum("fij,fijk->k", weighted, towards), weighted.sum()])


def glints(lights: Sequence[Light], eye_m: Array, start_ns: int, end_ns: int) -> Array:
    """Lamps (G, 3, 4) that no picture shows, the sun among them: those that shine most on an eye (3,).

    Each: place and 1, or direction and 0; intensity or illuminance of three channels, and the angle at which a spot
    ends; the spot's direction, and 1 / the angle over which it fades.
    """
    shining = [light for light in lights if isinstance(light, PointLight | SpotLight | Sun)]
    found = [_glint(light, start_ns, end_ns) for light in shining]
    if len(found) > MOST_GLINTS:
        found.sort(key=lambda rows: float(-rows[1, :3].sum() / np.sum((rows[0, :3] - rows[0, 3] * eye_m) ** 2)))
    return np.array(found[:MOST_GLINTS]).reshape(-1, 3, 4)


def _glint(light: PointLight | SpotLight | Sun, start_ns: int, end_ns: int) -> Array:
    power = light.level.mean(start_ns, end_ns) * np.array(light.colour)
    everywhere = 10.0
    no_axis = [0.0, 0.0, 0.0, 1.0]
    if isinstance(light, Sun):
        towards = light.direction((start_ns + end_ns) / 2)
        return np.array([[*towards, 0], [*light.illuminance_lx * power, everywhere], no_axis])
    if isinstance(light, PointLight):
        return np.array([[*light.position_m, 1], [*light.power_lm / (4 * np.pi) * power, everywhere], no_axis])
    inner, outer = np.deg2rad([light.inner_deg, light.outer_deg])
    fade = 1 / max(outer - inner, 1e-9)
    return np.array([[*light.position_m, 1], [*light.peak_cd * power, outer], [*light.direction, fade]])
