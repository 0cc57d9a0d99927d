"""Draw calls show what their batches, skies and samples are, at the luminance that light and material give them."""

from dataclasses import dataclass

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from vobench.geometry.camera import Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.background import StandardSky, even_sky
from vobench.rendering.batch import Geometry, geometry
from vobench.rendering.draw_call import DrawCalls
from vobench.rendering.gl_texture import LightTexture
from vobench.rendering.render_target import RenderTarget, render_target
from vobench.rendering.sample_pattern import ROTATED_GRID
from vobench.rendering.shader_define import ShaderDefine
from vobench.rendering.view import PinholeView, pinhole_view
from vobench.scene.material import LUMINANCE, Material, Rgb
from vobench.scene.mesh import quad
from vobench.scene.triangles import Thing, triangle_table

pytestmark = pytest.mark.usefixtures("gl_context")

CAMERA = Pinhole(8, 6, 8.0, 8.0, 3.5, 2.5)
AHEAD = looking(pitch_deg=0, position_m=(0, 0, 0))
WALL_M = 2.0
ILLUMINANCE_LX = 10.0
SKY_CD_M2 = 7.0
COLOUR = (0.2, 0.4, 0.6)
MATERIALS = {
    "grey": Material(colour=(0.5, 0.5, 0.5)),
    "red": Material(colour=COLOUR),
    "air": Material("pane", eta=1.0, tint=0.25),
}
PLAIN_SKY = even_sky(np.full(3, SKY_CD_M2))


def wall(material: str, *, x_m: float = WALL_M, first_m: float = 9.0, last_m: float = -9.0) -> Thing:
    """A rectangle across the view, from a place on the left to one on the right, which faces the camera."""
    return Thing(material, quad((x_m, first_m, -9.0), (0, last_m - first_m, 0), (0, 0, 18.0)), material)


@dataclass
class Stage:
    """Some things, and the framebuffers of a picture of them."""

    scene: Geometry
    calls: DrawCalls
    target: RenderTarget
    light: LightTexture

    def begin(self, weights: Rgb, skies: tuple[StandardSky, ...] = (), T_world_movers: tuple[Array, ...] = ()):
        view = pinhole_view(CAMERA, AHEAD, T_world_movers, skies, ambient_cd_m2=np.zeros(3))
        whole = self.target.total.whole
        self.target.total.clear(whole)
        self.target.framebuffer.clear(whole)
        self.calls.begin_view(view, self.target.framebuffer, weights, None)
        return view

    def surface(self, view: PinholeView, material: str) -> None:
        (batch,) = (batch for batch in self.scene.batches if batch.material is MATERIALS[material])
        clusters = self.scene.clusters
        rows = np.flatnonzero(clusters.batch == batch.index)
        runs = [(int(clusters.first[row]), int(clusters.count[row])) for row in rows]
        self.calls.draw_surface(batch, {batch.index: runs}, view, self.target.framebuffer)

    def mean(self, share: float = 1.0) -> Array:
        total = self.target.total
        self.calls.add_mean(self.target, total, total.whole, share)
        return total.read(total.whole)


def stage(*things: Thing, weights: Rgb | None = LUMINANCE, in_colour: bool = False, mover: int = -1) -> Stage:
    faces = triangle_table(list(things), [mover] * len(things), [-1] * len(things))
    light_uv = np.full((len(faces), 3, 2), 0.5, np.float32)
    scene = geometry(faces, light_uv, MATERIALS)
    light = LightTexture(np.full((1, 1), ILLUMINANCE_LX, np.float32))
    target = render_target(CAMERA.width_px, CAMERA.height_px, ROTATED_GRID, weights, in_colour=in_colour)
    return Stage(scene, DrawCalls(scene, light.id, {}), target, light)


def test_a_surface_has_the_luminance_of_lambert() -> None:
    shown = stage(wall("red"), weights=None)
    shown.surface(shown.begin(LUMINANCE), "red")
    expected = np.array(COLOUR) * ILLUMINANCE_LX / np.pi
    np.testing.assert_allclose(shown.mean(), np.broadcast_to(expected, (6, 8, 3)), rtol=1e-5)


def test_the_sky_is_behind_surfaces_and_skies_add_up() -> None:
    shown = stage(wall("grey", first_m=9, last_m=0))
    view = shown.begin(LUMINANCE, (PLAIN_SKY, PLAIN_SKY))
    shown.surface(view, "grey")
    shown.calls.draw_background(view, shown.target.framebuffer, LUMINANCE)
    picture = shown.mean()
    np.testing.assert_allclose(picture[:, :4], 0.5 * ILLUMINANCE_LX / np.pi, rtol=1e-5)
    np.testing.assert_allclose(picture[:, 4:], 2 * SKY_CD_M2, rtol=1e-5)


def test_an_edge_through_the_middle_of_pixels_halves_them() -> None:
    middle_of_column_4_m = -WALL_M * (4 - CAMERA.cx_px) / CAMERA.fx_px
    shown = stage(wall("grey", first_m=9, last_m=middle_of_column_4_m))
    shown.surface(shown.begin(LUMINANCE), "grey")
    shares = shown.mean()[0] / (0.5 * ILLUMINANCE_LX / np.pi)
    np.testing.assert_allclose(shares, [1, 1, 1, 1, 0.5, 0, 0, 0], rtol=1e-5)


def test_a_pane_multiplies_what_is_behind_it_and_does_not_hide_what_is_drawn_later() -> None:
    shown = stage(wall("grey"), wall("air", x_m=1.0))
    view = shown.begin(LUMINANCE)
    shown.surface(view, "grey")
    shown.surface(view, "air")
    through = 0.25 * 0.5 * ILLUMINANCE_LX / np.pi
    np.testing.assert_allclose(shown.mean(), through, rtol=1e-5)

    view = shown.begin(LUMINANCE)
    shown.surface(view, "air")
    shown.surface(view, "grey")
    np.testing.assert_allclose(shown.mean(), 4 * through, rtol=1e-5)


def test_a_mover_is_drawn_where_its_pose_puts_it_in_each_view() -> None:
    shown = stage(wall("grey", first_m=9, last_m=0), mover=0)
    for aside_m, lit_columns in ((0.0, 4), (-0.5, 6), (0.0, 4)):
        T_world_mover = np.eye(4)
        T_world_mover[1, 3] = aside_m
        shown.surface(shown.begin(LUMINANCE, T_world_movers=(T_world_mover,)), "grey")
        assert np.count_nonzero(shown.mean()[0] > 0) == lit_columns


def test_shares_of_sub_frames_add_up() -> None:
    shown = stage(wall("grey"))
    shown.surface(shown.begin(LUMINANCE), "grey")
    shown.mean(0.25)
    np.testing.assert_allclose(shown.mean(0.5), 0.75 * 0.5 * ILLUMINANCE_LX / np.pi, rtol=1e-5)


@pytest.mark.parametrize("in_colour", [False, True])
def test_a_picture_with_one_channel_is_the_weighted_sum_of_three(in_colour: bool) -> None:
    weights = (0.5, 0.0, 2.0)
    shown = stage(wall("red"), weights=weights, in_colour=in_colour)
    shown.surface(shown.begin(weights), "red")
    expected = np.array(COLOUR) @ weights * ILLUMINANCE_LX / np.pi
    np.testing.assert_allclose(shown.mean(), expected, rtol=1e-5)


def test_shaders_have_the_names_that_their_materials_need() -> None:
    shown = stage(wall("grey"), wall("red"), wall("air", x_m=1.0))
    defines = {}
    for batch, names in zip(shown.scene.batches, shown.calls.shader_defines, strict=True):
        (material,) = (name for name, each in MATERIALS.items() if each is batch.material)
        defines[material] = names
    assert defines["grey"] == {ShaderDefine.IS_GREY, ShaderDefine.HAS_LIGHT}
    assert defines["red"] == {ShaderDefine.HAS_LIGHT}
    assert ShaderDefine.IS_PANE in defines["air"]
    assert ShaderDefine.HAS_LIGHT not in defines["air"]
