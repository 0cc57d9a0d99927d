"""Pictures are reflectance times light over pi, linear, and the same bytes."""

import os
import pkgutil
import subprocess
import sys
from contextlib import closing
from dataclasses import replace
from typing import Any

import numpy as np
import pytest

import vobench.rendering
from tests.rendering.rectangles import box, rectangle, room
from vobench.asset.texture import Procedural
from vobench.geometry.camera import Camera, KannalaBrandt, Pinhole, pixel_grid
from vobench.geometry.rig import LENSES, looking
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakedScene, BakeSettings
from vobench.rendering.geometry import RayCaster
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import Radiance, View, single_instant
from vobench.scene.material import Material
from vobench.scene.scene import Scene, ceiling_light, triangles
from vobench.suite import catalog
from vobench.suite.scene_build import build
from vobench.suite.scene_file import read_scene

CAMERA = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
DOWN, AHEAD = looking(pitch_deg=90, position_m=(0.2, 0.1, 0.4)), looking(pitch_deg=20, position_m=(0.2, 0.1, 0.4))
LAMP = ceiling_light("lamp", np.array([0.5, 0.2, 2.4]), (0.5, 0.3), power_lm=2000)
MATERIALS = {
    "plain": Material(texture=Procedural("plain", 0.5, 0.0, 1.0, 8, 0)),
    "busy": Material(texture=Procedural("terrazzo", 0.5, 0.6, 1.0, 512, 1)),
}


def snap(renderer: RasterRenderer, camera: Camera, T_world_camera: Array) -> Radiance:
    return renderer.radiance(camera, single_instant(camera, T_world_camera))


@pytest.fixture(scope="module")
def furnished() -> BakedScene:
    """A small room with a crate, a lamp and bounces, baked coarsely."""
    surfaces = (
        *room((4, 3, 2.5), floor="busy", wall="plain", ceiling="plain"),
        *box(np.array([1.2, -0.3, 0.3]), (0.5, 0.4, 0.6), yaw_deg=20, material="busy"),
    )
    settings = BakeSettings(spacing_m=0.1, light_rays=4, indirect_spacing_m=0.3, indirect_rays=16)
    return bake(Scene("furnished", surfaces, MATERIALS, (LAMP,)), settings)


@pytest.fixture(scope="module")
def renderer(furnished: BakedScene, draw: Any) -> RasterRenderer:
    renderer: RasterRenderer = draw(furnished)
    return renderer


def test_the_same_picture_twice_is_the_same_bytes(renderer: RasterRenderer) -> None:
    assert snap(renderer, CAMERA, AHEAD).tobytes() == snap(renderer, CAMERA, AHEAD).tobytes()


def test_a_picture_does_not_depend_on_what_was_drawn_before(renderer: RasterRenderer) -> None:
    first, second = snap(renderer, CAMERA, DOWN), snap(renderer, CAMERA, AHEAD)
    large = snap(renderer, LENSES["paper_literal"], DOWN)
    assert snap(renderer, CAMERA, AHEAD).tobytes() == second.tobytes()
    assert snap(renderer, LENSES["paper_literal"], DOWN).tobytes() == large.tobytes()
    assert snap(renderer, CAMERA, DOWN).tobytes() == first.tobytes()


def test_a_picture_is_its_own_array_that_others_can_work_on(renderer: RasterRenderer) -> None:
    picture = snap(renderer, CAMERA, DOWN)
    assert (picture.shape, picture.dtype) == ((120, 180), np.float32)
    assert picture.flags.c_contiguous
    before = picture.copy()
    snap(renderer, CAMERA, AHEAD)
    np.testing.assert_array_equal(picture, before)


def test_renderers_live_side_by_side_and_one_outlives_the_others(furnished: BakedScene) -> None:
    first, second = RasterRenderer(furnished), RasterRenderer(furnished)
    expected = snap(first, CAMERA, AHEAD).tobytes()
    assert snap(second, CAMERA, AHEAD).tobytes() == expected
    first.close()
    assert snap(second, CAMERA, AHEAD).tobytes() == expected
    second.close()
    third = RasterRenderer(furnished)
    assert snap(third, CAMERA, AHEAD).tobytes() == expected
    third.close()


def test_luminance_of_a_plain_floor_is_reflectance_times_illuminance_over_pi(draw: Any) -> None:
    floor = rectangle(np.zeros(3), np.array([4.0, 0, 0]), np.array([0, 4.0, 0]), "plain")
    lamp = ceiling_light("lamp", np.array([0.3, -0.2, 2.0]), (0.04, 0.04), power_lm=1000)
    settings = BakeSettings(spacing_m=0.02, light_rays=16, indirect_spacing_m=1.0, indirect_rays=1, bounces=0)
    picture = snap(draw(bake(Scene("floor", (floor,), MATERIALS, (lamp,)), settings)), CAMERA, DOWN)
    rays = CAMERA.rays(pixel_grid(CAMERA))
    x, y, _ = np.moveaxis(DOWN[:3, 3] + 0.4 * rays / rays[..., 2:] @ DOWN[:3, :3].T, -1, 0)
    squared = (x - 0.3) ** 2 + (y + 0.2) ** 2 + 4.0
    np.testing.assert_allclose(picture, 0.5 / np.pi * 1000 / np.pi * 4.0 / squared**2, rtol=0.01)


@pytest.mark.parametrize("illuminance_lx", [1e-3, 1.0, 1e6])
def test_luminance_is_linear_from_moonlight_to_beyond_the_sun(
    draw: Any, even_light: Any, illuminance_lx: float
) -> None:
    scene = Scene("room", tuple(room((4, 4, 2), floor="plain", wall="plain", ceiling="plain")), MATERIALS, ())
    picture = snap(draw(even_light(scene, illuminance_lx=illuminance_lx)), CAMERA, AHEAD)
    np.testing.assert_allclose(picture, 0.5 * illuminance_lx / np.pi, rtol=2e-5)


def test_twice_the_light_is_exactly_twice_the_picture(draw: Any, even_light: Any) -> None:
    surfaces = tuple(room((4, 4, 2), floor="busy", wall="busy", ceiling="plain"))
    scene = Scene("room", surfaces, MATERIALS, ())
    once, twice = (snap(draw(even_light(scene, illuminance_lx=lx)), CAMERA, AHEAD) for lx in (70.0, 140.0))
    np.testing.assert_array_equal(twice, 2 * once)


def test_a_far_texture_fades_to_its_mean_and_keeps_its_brightness(draw: Any, even_light: Any) -> None:
    board = rectangle(np.array([40.0, 0, 0]), np.array([0, -60.0, 0]), np.array([0, 0, 40.0]), "busy")
    renderer = draw(even_light(Scene("board", (board,), MATERIALS, ()), illuminance_lx=np.pi))
    picture = snap(renderer, CAMERA, looking(pitch_deg=0, position_m=(0, 0, 0)))
    assert picture.mean() == pytest.approx(0.5, rel=0.003)
    assert picture.std() < 0.03


def test_a_lamp_in_view_shows_its_luminance_and_its_back_is_not_there(renderer: RasterRenderer) -> None:
    lamp = LAMP.luminance_cd_m2
    up = looking(pitch_deg=-90, position_m=(0.5, 0.2, 1.5))
    assert snap(renderer, CAMERA, up)[60, 90] == pytest.approx(lamp, rel=1e-5)
    from_above = looking(pitch_deg=90, position_m=(0.5, 0.2, 2.49))
    assert snap(renderer, CAMERA, from_above)[60, 90] < lamp / 10


def hit_distance(scene: Scene, T_world_camera: Array) -> Array:
    """Distance (H, W) in metres along the rays through the pixels' centres; NaN where nothing is."""
    rays = CAMERA.rays(pixel_grid(CAMERA)).reshape(-1, 3) @ T_world_camera[:3, :3].T
    caster = RayCaster(triangles(scene))
    hits = caster.hits(np.broadcast_to(T_world_camera[:3, 3], rays.shape), rays)
    return hits.distance.reshape(CAMERA.height_px, CAMERA.width_px)


def test_where_nothing_is_the_picture_is_black(draw: Any, even_light: Any) -> None:
    floor = rectangle(np.zeros(3), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "plain")
    scene = Scene("floor", (floor,), MATERIALS, ())
    picture = snap(draw(even_light(scene, illuminance_lx=np.pi)), CAMERA, AHEAD)
    assert picture[0, 90] == 0
    assert ((picture > 0) == np.isfinite(hit_distance(scene, AHEAD))).mean() > 0.99


def test_rays_and_picture_agree_on_where_the_crate_is(draw: Any, even_light: Any) -> None:
    materials = {
        "dark": Material(texture=Procedural("plain", 0.1, 0, 1, 8, 0)),
        "bright": Material(texture=Procedural("plain", 0.9, 0, 1, 8, 0)),
    }
    crate = box(np.array([1.5, 0.1, 0.4]), (0.5, 0.5, 0.5), yaw_deg=30, material="bright")
    surfaces = (*room((20, 20, 20), floor="dark", wall="dark", ceiling="dark"), *crate)
    scene = Scene("crate", surfaces, materials, ())
    view = looking(pitch_deg=0, position_m=(0, 0, 0.4))
    # Above the near floor, which is as near as the crate.
    picture = snap(draw(even_light(scene, illuminance_lx=np.pi)), CAMERA, view)[:75]
    distance = hit_distance(scene, view)[:75]
    whole = (picture < 0.11) | (picture > 0.89)  # pixels without an edge in them
    np.testing.assert_array_equal(picture[whole] > 0.5, distance[whole] < 2.5)
    assert (picture[whole] > 0.5).sum() > 1000


def test_a_triangle_seen_edge_on_leaves_no_undefined_pixel() -> None:
    # The floor of the car park has strips a few millimetres below it. From here, software drawing with llvmpipe
    # clips one of them to a sliver without area, which covered one sample, and its luminance was not a number.
    whole = build(read_scene(catalog.find("scene", "car_park").path), {})
    floor = tuple(thing for thing in whole.things if thing.name == "floor")
    scene = replace(whole, things=floor, lights=(), movers=())
    coarse = BakeSettings(spacing_m=0.2, light_rays=1, indirect_spacing_m=0.8, indirect_rays=4, bounces=0)
    camera = Pinhole(360, 240, 329.1428571428571, 329.1428571428571, 179.5, 119.5)
    T_world_camera = np.array(
        [
            [0.35700336373659386, -0.1622053007753472, 0.919911973332849, 0.5134468947470547],
            [-0.9341030983145047, -0.061992983533823806, 0.351579680459235, 0.21983566475029082],
            [0.0, -0.984807753012208, -0.17364817766693033, 0.4],
            [0.0, 0.0, 0.0, 1.0],
        ]
    )
    with closing(RasterRenderer(bake(scene, coarse))) as renderer:
        picture = renderer.radiance(camera, single_instant(camera, T_world_camera))
    assert not np.isnan(picture).any()


FINER = 6  # the ratio of resolutions of the picture that stands for the exact one


def finer(camera: Pinhole) -> Pinhole:
    """A camera with the same view, and FINER² pixels in the place of each."""
    return Pinhole(
        FINER * camera.width_px,
        FINER * camera.height_px,
        FINER * camera.fx_px,
        FINER * camera.fy_px,
        FINER * (camera.cx_px + 0.5) - 0.5,
        FINER * (camera.cy_px + 0.5) - 0.5,
    )


def test_sixteen_samples_are_nearer_to_the_mean_over_the_pixel_than_four(furnished: BakedScene) -> None:
    with closing(RasterRenderer(furnished)) as usual, closing(RasterRenderer(furnished, samples=16)) as fine:
        with_four = snap(usual, CAMERA, AHEAD)
        with_sixteen = snap(fine, CAMERA, AHEAD)
        large = snap(fine, finer(CAMERA), AHEAD).astype(float)
    exact = large.reshape(CAMERA.height_px, FINER, CAMERA.width_px, FINER).mean((1, 3))
    is_edge = np.abs(with_four - exact) > 0.02 * exact.mean()
    assert is_edge.sum() > 100
    rms_of_four = np.sqrt(((with_four - exact)[is_edge] ** 2).mean())
    rms_of_sixteen = np.sqrt(((with_sixteen - exact)[is_edge] ** 2).mean())
    assert rms_of_sixteen < 0.5 * rms_of_four


@pytest.mark.parametrize("count", [1, 4])
def test_sixteen_samples_are_the_same_in_sub_frames_of_one_pose(furnished: BakedScene, count: int) -> None:
    now = np.zeros(count, np.int64)
    view = View(slice(0, CAMERA.height_px), np.repeat(AHEAD[None], count, 0), now, now)
    with closing(RasterRenderer(furnished, samples=16)) as fine:
        picture = fine.radiance(CAMERA, [view])
        np.testing.assert_allclose(picture, snap(fine, CAMERA, AHEAD), rtol=3e-5)


def test_a_lens_that_resamples_pictures_has_finer_ones_with_sixteen_samples(furnished: BakedScene) -> None:
    lens = KannalaBrandt(180, 120, 60.0, 60.0, 90.0, 60.0, 0.0, 0.0, 0.0, 0.0)
    with closing(RasterRenderer(furnished)) as usual, closing(RasterRenderer(furnished, samples=16)) as fine:
        with_four = snap(usual, lens, AHEAD)
        with_sixteen = snap(fine, lens, AHEAD)
    difference = np.abs(with_sixteen - with_four) / with_four.mean()
    assert 0 < np.median(difference) < 0.01
    assert difference.max() > 0.05


# Hides X11's libraries, by name as ctypes finds them and by file as it loads them, then imports modules.
WITHOUT_X11 = """
import ctypes, ctypes.util, importlib, sys

def hidden(name):
    return "libX" in str(name) or str(name).startswith("X")

def refuse(self, name, *rest, load=ctypes.CDLL.__init__, **options):
    if hidden(name):
        raise OSError(f"{name}: cannot open shared object file")
    load(self, name, *rest, **options)

find = ctypes.util.find_library
ctypes.util.find_library = lambda name: None if hidden(name) else find(name)
ctypes.CDLL.__init__ = refuse
for module in sys.argv[1:]:
    importlib.import_module(module)
"""
MODULES = [module.name for module in pkgutil.iter_modules(vobench.rendering.__path__, "vobench.rendering.")]


def run_without_x11(*modules: str) -> subprocess.CompletedProcess[str]:
    environment = {key: value for key, value in os.environ.items() if not key.startswith(("PYGLET", "PYOPENGL"))}
    command = [sys.executable, "-c", WITHOUT_X11, *modules]
    return subprocess.run(command, env=environment, capture_output=True, text=True, check=False)


def test_every_module_of_the_room_is_imported_without_a_library_of_x11() -> None:
    finished = run_without_x11(*MODULES)
    assert finished.returncode == 0, finished.stderr[-400:]


def test_a_machine_without_x11_is_told_from_one_with_it() -> None:
    finished = run_without_x11("pyglet.libs.x11.xlib")
    assert finished.returncode == 1
    assert "X11" in finished.stderr


# Recordings are read, scenes checked and truth computed where no picture can be drawn.
UNDRAWN = [
    "vobench.rendering.raster",
    "vobench.rendering.context",
    "vobench.rendering.truth",
    "vobench.runner.simulate",
    "vobench.cli.doctor",
]


def test_what_draws_nothing_loads_no_opengl() -> None:
    lines = [
        *(f"import {module}" for module in UNDRAWN),
        "import sys",
        "print({'OpenGL', 'pyrender'} & set(sys.modules))",
    ]
    command = [sys.executable, "-c", "; ".join(lines)]
    assert subprocess.run(command, capture_output=True, text=True, check=True).stdout == "set()\n"
