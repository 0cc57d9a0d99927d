"""Strips and sub-frames: the same picture however it is cut, and the mean of what was seen meanwhile."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest

from tests.rendering.rectangles import box, rectangle, room
from vobench.asset.texture import Procedural
from vobench.geometry import se3
from vobench.geometry.camera import Camera, DoubleSphere, KannalaBrandt, Pinhole
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.bake import bake
from vobench.rendering.baked_scene import BakeSettings
from vobench.rendering.raster import RasterRenderer
from vobench.rendering.renderer import View, single_instant
from vobench.scene.light import Dimmer, Flicker, Sky
from vobench.scene.material import Material
from vobench.scene.scene import Mover, Scene, WaypointMotion

PINHOLE = Pinhole(180, 120, 164.5, 136.2, 89.5, 59.5)
CAMERAS = {
    "pinhole": PINHOLE,
    "fisheye": KannalaBrandt(180, 120, 60.0, 60.0, 90.0, 60.0, 0.0, 0.0, 0.0, 0.0),
    "sphere": DoubleSphere(181, 121, 70.0, 71.0, 90.0, 60.0, -0.2, 0.6),
}
AHEAD = looking(pitch_deg=20, position_m=(-1.0, 0.1, 0.6))
MATERIALS = {
    "wax": Material(texture=Procedural("terrazzo", 0.4, 0.6, 1.0, 512, 1), eta=1.5),
    "wall": Material(texture=Procedural("plaster", 0.5, 0.4, 1.0, 512, 2)),
    "steel": Material("mirror", tint=0.8, roughness=0.08),
    "chrome": Material("mirror", tint=0.8),
    "glass": Material("pane", eta=1.5),
    "board": Material(texture=Procedural("checker", 0.5, 0.8, 0.5, 64, 0)),
}
SECOND_NS = 1_000_000_000
PATH = WaypointMotion(np.array([0.0, 2.0]), np.array([[1.0, -0.8, 0.3], [1.0, 0.8, 0.3]]), np.array([0.0, 60.0]))
CART = Mover("cart", tuple(box(np.zeros(3), (0.5, 0.5, 0.5), yaw_deg=0, material="board")), PATH)
SURFACES = (
    *(s for s in room((6, 5, 3), floor="wax", wall="wall", ceiling="wall") if s.name != "wall_east"),
    rectangle(np.array([3.0, 0, 1.5]), np.array([0, 0, 3.0]), np.array([0, 5.0, 0]), "glass"),
    rectangle(np.array([1.0, 2.4, 1.0]), np.array([2.0, 0, 0]), np.array([0, 0, 1.6]), "steel"),
)
GALLERY = Scene("gallery", SURFACES, MATERIALS, (Sky("sky", 1000.0, "clear"),), (CART,))
DARK = replace(GALLERY, lights=())  # without daylight, which movers would shade
every_camera = pytest.mark.parametrize("camera", CAMERAS.values(), ids=list(CAMERAS))


@pytest.fixture(scope="module")
def gallery(draw: Any, even_light: Any) -> RasterRenderer:
    renderer: RasterRenderer = draw(even_light(GALLERY))
    return renderer


def instants(*times_ns: int) -> Any:
    return np.array(times_ns, np.int64)


def poses(count: int) -> Array:
    """Poses on a turning way ahead."""
    turns = se3.rotation_z(np.linspace(0, 0.1, count))
    return se3.transform(turns, np.linspace([0, 0, 0], [0.1, 0.05, 0], count)) @ AHEAD


def cut(height: int, T_world_camera: Array, times_ns: Any, *, count: int) -> list[View]:
    edges = np.linspace(0, height, count + 1).astype(int).tolist()
    return [View(slice(a, b), T_world_camera, times_ns, times_ns) for a, b in pairwise(edges)]


@every_camera
@pytest.mark.parametrize("count", [3, 40])
def test_strips_of_one_pose_are_the_whole_picture(gallery: RasterRenderer, camera: Camera, count: int) -> None:
    strips = cut(camera.height_px, AHEAD[None], instants(SECOND_NS), count=count)
    whole = gallery.radiance(camera, single_instant(camera, AHEAD, t_ns=SECOND_NS))
    assert gallery.radiance(camera, strips).tobytes() == whole.tobytes()
    assert whole.std() > 0


@every_camera
def test_strips_of_many_poses_are_cut_from_the_pictures_of_those_poses(gallery: RasterRenderer, camera: Camera) -> None:
    way, edges = poses(4), [0, 30, 60, 90, camera.height_px]
    rows = [slice(a, b) for a, b in pairwise(edges)]
    now = instants(SECOND_NS)
    rolled = gallery.radiance(camera, [View(r, T[None], now, now) for r, T in zip(rows, way, strict=True)])
    for r, T in zip(rows, way, strict=True):
        np.testing.assert_array_equal(rolled[r], gallery.radiance(camera, single_instant(camera, T, t_ns=SECOND_NS))[r])


@every_camera
@pytest.mark.parametrize("count", [2, 3, 8])
def test_sub_frames_of_one_pose_are_the_still(gallery: RasterRenderer, camera: Camera, count: int) -> None:
    now = instants(*[SECOND_NS] * count)
    view = View(slice(0, camera.height_px), np.repeat(AHEAD[None], count, 0), now, now)
    whole = gallery.radiance(camera, single_instant(camera, AHEAD, t_ns=SECOND_NS))
    np.testing.assert_allclose(gallery.radiance(camera, [view]), whole, rtol=3e-5)


@every_camera
def test_a_blurred_picture_is_the_mean_of_its_sub_frames(gallery: RasterRenderer, camera: Camera) -> None:
    times = instants(0, SECOND_NS // 2, SECOND_NS)
    blurred = gallery.radiance(camera, [View(slice(0, camera.height_px), poses(3), times, times)])
    sharp = [
        gallery.radiance(camera, single_instant(camera, T, t_ns=int(t)))
        for T, t in zip(poses(3), times.tolist(), strict=True)
    ]
    np.testing.assert_allclose(blurred, np.mean(sharp, 0), rtol=1e-4, atol=1e-4)


def test_strips_with_sub_frames_are_the_picture_with_sub_frames(gallery: RasterRenderer) -> None:
    times = instants(0, SECOND_NS // 2, SECOND_NS)
    blurred = gallery.radiance(PINHOLE, [View(slice(0, 120), poses(3), times, times)])
    assert gallery.radiance(PINHOLE, cut(120, poses(3), times, count=7)).tobytes() == blurred.tobytes()


def test_two_renderers_side_by_side_draw_the_same_bytes(gallery: RasterRenderer, even_light: Any) -> None:
    other = RasterRenderer(even_light(GALLERY))
    for camera in CAMERAS.values():
        view = single_instant(camera, AHEAD, t_ns=SECOND_NS // 3)
        assert other.radiance(camera, view).tobytes() == gallery.radiance(camera, view).tobytes()
    other.close()


def test_a_mover_is_where_its_path_says_amid_the_interval(draw: Any, even_light: Any) -> None:
    start, end, rows = instants(SECOND_NS // 2), instants(SECOND_NS), slice(0, PINHOLE.height_px)
    T = PATH.pose(0.75 * SECOND_NS)
    diffuse = replace(DARK, materials=MATERIALS | {"wax": MATERIALS["wall"], "steel": MATERIALS["wall"]})
    parked = replace(diffuse, movers=(), things=(*SURFACES, *(s.moved(T) for s in CART.things)))
    empty = replace(diffuse, movers=())
    moving, standing, without = (
        draw(even_light(scene)).radiance(PINHOLE, [View(rows, AHEAD[None], start, end)])
        for scene in (diffuse, parked, empty)
    )
    # How the mover is lit is another matter; where it hides the room is this one.
    np.testing.assert_array_equal(moving != without, standing != without)
    assert (moving != without).mean() > 0.02


def test_a_mirror_that_moves_mirrors_from_where_it_is(draw: Any, even_light: Any) -> None:
    materials = MATERIALS | {"steel": MATERIALS["wall"], "wax": MATERIALS["wall"]}
    cart = replace(CART, things=(replace(CART.things[3], material="chrome"),))
    plain = replace(DARK, materials=materials)
    moving = draw(even_light(replace(plain, movers=(cart,)))).radiance(
        PINHOLE, single_instant(PINHOLE, AHEAD, t_ns=SECOND_NS)
    )
    T = PATH.pose(SECOND_NS)
    parked = replace(plain, movers=(), things=(*SURFACES, *(s.moved(T) for s in cart.things)))
    diffuse = replace(parked, materials=materials | {"chrome": MATERIALS["board"]})
    standing, without = (
        draw(even_light(one)).radiance(PINHOLE, single_instant(PINHOLE, AHEAD)) for one in (parked, diffuse)
    )
    assert (np.abs(moving - standing) > 0.01 * standing).mean() < 0.002
    assert (standing != without).mean() > 0.01


def test_without_any_light_a_place_with_movers_is_black(draw: Any) -> None:
    picture = draw(bake(DARK, BakeSettings(0.2, bounces=0))).radiance(PINHOLE, single_instant(PINHOLE, AHEAD))
    assert picture.max() == 0


def test_a_light_counts_with_its_mean_over_each_sub_frame(draw: Any, even_light: Any) -> None:
    flicker = Flicker(depth=0.8)
    surfaces = tuple(room((4, 4, 2), floor="wall", wall="wall", ceiling="wall"))
    scene = Scene("room", surfaces, MATERIALS, ())
    lit, steady = (draw(even_light(scene, **level)) for level in ({"level": flicker}, {}))
    start, end = instants(0, 3_000_000), instants(2_000_000, 7_000_000)
    view = View(slice(0, 120), np.repeat(AHEAD[None], 2, 0), start, end)
    level = (flicker.mean(0, 2_000_000) + flicker.mean(3_000_000, 7_000_000)) / 2
    np.testing.assert_allclose(
        lit.radiance(PINHOLE, [view]), level * steady.radiance(PINHOLE, single_instant(PINHOLE, AHEAD)), rtol=1e-5
    )


def test_the_sky_follows_its_level(draw: Any, even_light: Any) -> None:
    pane = rectangle(np.array([0, 0, -9.0]), np.array([1.0, 0, 0]), np.array([0, 1.0, 0]), "wall")
    sky = Sky("sky", 1000.0, level=Dimmer((0.0, 1.0), (1.0, 0.0)))
    renderer = draw(even_light(Scene("sky", (pane,), MATERIALS, (sky,))))
    bright, dim = (renderer.radiance(PINHOLE, single_instant(PINHOLE, AHEAD, t_ns=t)) for t in (0, SECOND_NS * 3 // 4))
    np.testing.assert_allclose(dim, bright / 4, rtol=1e-5)


@pytest.mark.parametrize("rows", [[(0, 50), (60, 120)], [(0, 119)], [(0, 70), (60, 120)]])
def test_views_that_do_not_tile_the_picture_are_refused(gallery: RasterRenderer, rows: list[tuple[int, int]]) -> None:
    now = instants(0)
    with pytest.raises(ValueError, match="views must tile the rows 0 to 120"):
        gallery.radiance(PINHOLE, [View(slice(a, b), AHEAD[None], now, now) for a, b in rows])
