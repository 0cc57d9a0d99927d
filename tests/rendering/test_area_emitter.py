"""What a lamp gives without shadows is what its places add up to, and never more than physics allows."""

import numpy as np
import pytest

from tests.rendering.receivers import receivers, summed
from tests.rendering.rectangles import rectangle, room
from vobench.rendering.area_emitter import MeshPanel, Panel, panel_emitter
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.illumination import Illumination
from vobench.scene.light import AreaLight
from vobench.scene.material import Material
from vobench.scene.mesh import face_corners
from vobench.scene.scene import Scene, ceiling_light

LAMP = ceiling_light("lamp", np.array([0.2, 0.1, 2.0]), (0.8, 0.5), power_lm=1000)
SAMPLES = 2000


@pytest.mark.parametrize(("eta", "tolerance"), [(0.0, 1e-3), (1.5, 0.01)])
@pytest.mark.parametrize("tilt", [(0.0, 0.0, 1.0), (0.5, -0.3, 0.8)])
def test_the_unshadowed_light_of_a_panel_is_the_sum_over_its_places(
    eta: float, tolerance: float, tilt: tuple[float, float, float]
) -> None:
    texels = receivers(eta=eta, tilt=tilt)
    panel = panel_emitter(LAMP)
    light = panel.unshadowed_light(texels)
    np.testing.assert_allclose(light, summed(panel, texels), rtol=2 * tolerance, atol=tolerance * light.max())


@pytest.mark.parametrize("distance_m", [1e-5, 1e-3, 0.1, 1.0])
def test_no_point_gets_more_than_a_panel_that_fills_its_sky_gives(distance_m: float) -> None:
    texels = receivers(eta=0.0)
    texels.points_m[:, 2] = LAMP.mesh.vertices[0, 2] - distance_m
    texels.points_m[0, :2] = 0.2, 0.1
    light = panel_emitter(LAMP).unshadowed_light(texels)
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


def test_a_rectangle_is_a_panel_and_half_of_it_a_mesh() -> None:
    assert isinstance(panel_emitter(LAMP), Panel)
    triangle = LAMP.mesh.submesh([[0]], append=True)
    half = panel_emitter(AreaLight("half", triangle, 500.0))
    assert isinstance(half, MeshPanel)
    assert half.least_side > panel_emitter(LAMP).least_side
    np.testing.assert_allclose(half.corners_m, face_corners(LAMP.mesh)[:1])


def test_the_light_of_a_mesh_is_that_of_its_parts() -> None:
    texels = receivers(eta=0.0)
    far = texels.take(texels.points_m[:, 2] < 0.5)
    by_halves = np.zeros(len(far))
    for face in (0, 1):
        half = panel_emitter(AreaLight("half", LAMP.mesh.submesh([[face]], append=True), 500.0))
        aim = half.towards(far)
        numbers = np.random.default_rng(face)
        for _ in range(SAMPLES):
            vectors_m, strength = aim(*numbers.random((2, len(far)), dtype=np.float32))
            by_halves += strength * far.cosine(vectors_m) / SAMPLES
    np.testing.assert_allclose(by_halves, panel_emitter(LAMP).unshadowed_light(far), rtol=0.03)
