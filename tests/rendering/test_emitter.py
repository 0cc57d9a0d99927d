"""What an emitter gives without shadows is what its places add up to, and never more than physics allows."""

import numpy as np
import pytest

from tests.rendering.rectangles import rectangle, room
from vobench.rendering.bake import BakeSettings, bake
from vobench.rendering.emitter import emitters, panel_emitter
from vobench.rendering.illumination import Illumination
from vobench.rendering.texel import Texels
from vobench.rendering.visibility import Visibility
from vobench.scene.light import AreaLight, Sky
from vobench.scene.material import Material
from vobench.scene.scene import Scene, ceiling_light
from vobench.scene.triangles import triangle_table

LAMP = ceiling_light("lamp", np.array([0.2, 0.1, 2.0]), (0.8, 0.5), power_lm=1000)
FLOOR = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "floor")
SIDE = 64


def receivers(*, eta: float, tilt: tuple[float, float, float] = (0.0, 0.0, 1.0)) -> Texels:
    """Points on and above the floor that look one way."""
    numbers = np.random.default_rng(0)
    points_m = np.append(numbers.uniform(-2, 2, (40, 2)), numbers.uniform(0, 1.9, (40, 1)), 1).astype(np.float32)
    normal = np.array(tilt) / np.linalg.norm(tilt)
    normals = np.tile(normal, (40, 1)).astype(np.float32)
    nowhere = np.zeros((40, 3), np.float32)
    rows = np.arange(40)
    return Texels(
        points_m=points_m,
        normals=normals,
        planes=normals,
        step_u_m=nowhere,
        step_v_m=nowhere,
        index=rows,
        face=rows.astype(np.int32),
        uv=np.zeros((40, 2), np.float32),
        eta=np.full(40, eta, np.float32),
        dither=numbers.random((40, 2), dtype=np.float32),
    )


def summed(emitter: object, texels: Texels) -> np.ndarray:
    """The mean over many places on the emitter."""
    aim = emitter.towards(texels)
    total = np.zeros(len(texels))
    for column, row in np.ndindex(SIDE, SIDE):
        a = np.full(len(texels), (column + 0.5) / SIDE, np.float32)
        b = np.full(len(texels), (row + 0.5) / SIDE, np.float32)
        vectors_m, strength = aim(a, b)
        cosine = texels.cosine(vectors_m)
        total += strength * np.maximum(cosine, 0) * texels.entering(cosine)
    return total / SIDE**2


@pytest.mark.parametrize(("eta", "tolerance"), [(0.0, 1e-3), (1.5, 0.01)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 1.0), (0.5, -0.3, 0.8)])
def test_a_panels_open_light_is_the_sum_over_its_places(
    eta: float, tolerance: float, tilt: tuple[float, float, float]
) -> None:
    texels = receivers(eta=eta, tilt=tilt)
    panel = panel_emitter(LAMP)
    light = panel.open_light(texels)
    np.testing.assert_allclose(light, summed(panel, texels), rtol=2 * tolerance, atol=tolerance * light.max())


@pytest.mark.parametrize("kind", ["uniform", "overcast", "clear"])
@pytest.mark.parametrize("eta", [0.0, 1.5])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 1.0), (0.5, -0.3, 0.8), (-0.9, 0.4, -0.1), (0.0, 0.0, -1.0)])
def test_the_open_skys_light_is_the_sum_over_its_places(
    kind: str, eta: float, tilt: tuple[float, float, float]
) -> None:
    faces = triangle_table([FLOOR], [-1], [-1])
    sky = Sky("sky", 10_000.0, kind, np.array([0.5, 0.3, np.sqrt(0.66)]))
    (emitter,) = emitters(sky, Visibility(faces, {"floor": Material()}, np.arange(len(faces))))
    texels = receivers(eta=eta, tilt=tilt).take(slice(0, 1))
    np.testing.assert_allclose(emitter.open_light(texels), summed(emitter, texels), rtol=0.01)


@pytest.mark.parametrize("distance_m", [1e-5, 1e-3, 0.1, 1.0])
def test_no_point_gets_more_than_a_panel_that_fills_its_sky_gives(distance_m: float) -> None:
    texels = receivers(eta=0.0)
    texels.points_m[:, 2] = LAMP.mesh.vertices[0, 2] - distance_m
    texels.points_m[0, :2] = 0.2, 0.1
    light = panel_emitter(LAMP).open_light(texels)
    limit_lx = np.pi * LAMP.luminance_cd_m2
    assert np.nanmax(light) <= limit_lx * (1 + 1e-6)
    if distance_m < 1e-2:
        assert np.nanmax(light) > 0.95 * limit_lx


@pytest.mark.parametrize("albedo", [0.5, 0.8])
def test_where_all_directions_are_as_bright_every_place_has_that_light_and_none_more(albedo: float) -> None:
    """A board in a closed room whose walls, floor and ceiling glow alike: E = πL, whatever its albedo."""
    luminance = 100.0
    shell = room((3, 2.5, 2.5), floor="grey", wall="grey", ceiling="grey")
    glowing = [
        AreaLight(f"glow {nth}", part.mesh, np.pi * luminance * float(part.mesh.area)) for nth, part in enumerate(shell)
    ]
    target = rectangle(np.array([0.2, 0.1, 1.0]), np.array([0.8, 0, 0]), np.array([0, 0.6, 0]), "grey", "target")
    under = rectangle(np.array([0.2, 0.1, 0.98]), np.array([0, 0.6, 0]), np.array([0.8, 0, 0]), "grey", "under")
    settings = BakeSettings(spacing_m=0.05, indirect_rays=64, bounces=8)
    baked = bake(Scene("furnace", (target, under), {"grey": Material(colour=(albedo,) * 3)}, tuple(glowing)), settings)
    light = Illumination(baked).at(0, 0)[..., 0]
    lit = light.ravel()[baked.patches.surfel_of >= 0]
    np.testing.assert_allclose(lit, np.pi * luminance, rtol=0.02)
    assert lit.max() <= np.pi * luminance * 1.005
