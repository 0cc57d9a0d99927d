"""Pictures of leaves in wind: they are where the ground truth says, and nothing else in a picture changes."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
import scipy

from tests.rendering.rectangles import rectangle
from vobench.asset.texture import Procedural
from vobench.geometry.camera import Pinhole, pixel_grid
from vobench.geometry.rig import looking
from vobench.geometry.se3 import Array
from vobench.rendering.renderer import single_instant
from vobench.rendering.truth import CameraShot, TruthCaster
from vobench.scene.light import PointLight
from vobench.scene.material import Material
from vobench.scene.mesh import as_arrays, as_mesh
from vobench.scene.mesh_arrays import joined_arrays
from vobench.scene.scene import Scene
from vobench.scene.triangles import Thing
from vobench.scene.wind import Wind

CAMERA = Pinhole(180, 120, 164.5, 164.5, 89.5, 59.5)
T_WORLD_CAMERA = looking(pitch_deg=0, position_m=(0.0, 0.0, 0.0))
WIND = Wind(speed_mps=14.0, towards_deg=80.0)
TIMES_NS = (0, 400_000_000, 5_000_000_000)
MATERIALS = {
    "wall": Material(texture=Procedural("terrazzo", 0.2, 0.5, 1.0, 256, 1)),
    "leaf": Material(colour=(1.0, 1.0, 1.0), is_foliage=True),
}
WALL = rectangle(np.array([6.0, 0, 0]), np.array([0, 0, 9.0]), np.array([0, 12.0, 0]), "wall")


def leaves() -> Thing:
    """Upright squares at different distances, above one another: a crown of two tiers, to be seen from x."""
    squares = []
    for x, y, z in ((3.0, -0.5, -0.8), (3.4, 0.4, -0.5), (3.0, 0.0, 0.5), (3.7, -0.8, 0.8), (3.2, 0.6, 0.9)):
        square = rectangle(np.array([x, y, z]), np.array([0, 0, 0.4]), np.array([0, 0.4, 0]), "leaf")
        squares.append(as_arrays(square.mesh))
    return Thing("tree", as_mesh(joined_arrays(squares)), "leaf")


def scene(wind: Wind | None = WIND) -> Scene:
    return Scene("wood", (WALL, leaves()), MATERIALS, (), wind=wind)


def drawn(draw: Any, even_light: Any, wind: Wind | None, t_ns: int) -> Array:
    renderer = draw(even_light(scene(wind)))
    return np.asarray(renderer.radiance(CAMERA, single_instant(CAMERA, T_WORLD_CAMERA, t_ns=t_ns)))


def is_inside(mask: Array) -> Array:
    """The pixels whose neighbours are all in a mask (H, W), too."""
    return np.asarray(scipy.ndimage.binary_erosion(mask, np.ones((3, 3)), border_value=1))


@pytest.mark.parametrize("t_ns", TIMES_NS)
def test_leaves_are_drawn_where_the_truth_says_that_things_move(draw, even_light, t_ns: int) -> None:
    picture = drawn(draw, even_light, WIND, t_ns)
    truth = TruthCaster(scene()).frame(CAMERA, CameraShot(T_WORLD_CAMERA, t_ns), ["moving", "instance", "depth"])
    is_leaf = truth.moving
    assert 0.02 < is_leaf.mean() < 0.3
    white = 100 / np.pi
    assert picture[is_inside(is_leaf)] == pytest.approx(white, rel=0.01)
    assert (picture[is_inside(~is_leaf)] < 0.8 * white).all()
    assert (truth.depth[is_leaf] < 4.5).all()
    names = np.array(TruthCaster(scene()).names.instance)
    assert set(names[truth.instance[is_leaf]]) == {"tree"}


def test_flow_leads_each_leaf_to_its_place_in_the_next_picture() -> None:
    caster = TruthCaster(scene())
    shots = [CameraShot(T_WORLD_CAMERA, t_ns) for t_ns in TIMES_NS]
    here = caster.frame(CAMERA, shots[1], later=shots[2])
    there = caster.frame(CAMERA, shots[2], ["depth", "moving"])
    goes_px = pixel_grid(CAMERA) + here.flow
    is_seen = here.moving & ~here.occlusion
    assert np.abs(here.flow[is_seen]).max() > 3
    assert np.abs(here.flow[~here.moving]).max() < 1e-6
    column, row = np.rint(goes_px[is_seen]).astype(int).T
    inside = is_inside(there.moving)[row, column]
    assert inside.mean() > 0.7
    assert there.moving[row, column].mean() > 0.97


def test_the_truth_of_a_rolling_shutter_has_the_leaves_of_each_row_at_its_own_time() -> None:
    height_px = CAMERA.height_px
    stamps = TIMES_NS[1] + np.arange(height_px) * 5_000_000
    caster = TruthCaster(scene())
    by_row = caster.frame(CAMERA, CameraShot(np.tile(T_WORLD_CAMERA, (height_px, 1, 1)), stamps), ["depth", "moving"])
    for row in (20, 60, 100):
        at_once = caster.frame(CAMERA, CameraShot(T_WORLD_CAMERA, int(stamps[row])), ["depth", "moving"])
        assert np.array_equal(by_row.moving[row], at_once.moving[row])
        assert by_row.depth[row] == pytest.approx(at_once.depth[row], rel=1e-6)


def test_only_leaves_change_in_wind(draw, even_light) -> None:
    calm = drawn(draw, even_light, None, 0)
    windy = drawn(draw, even_light, WIND, TIMES_NS[1])
    frames = []
    for wind, t_ns in ((None, 0), (WIND, TIMES_NS[1])):
        truth = TruthCaster(scene(wind)).frame(CAMERA, CameraShot(T_WORLD_CAMERA, t_ns), ["instance"])
        frames.append(truth.instance == truth.instance.max())
    is_still = is_inside(~(frames[0] | frames[1]))
    assert is_still.mean() > 0.5
    assert np.array_equal(calm[is_still], windy[is_still])
    assert not np.array_equal(calm, windy)


def test_a_calm_scene_is_drawn_as_one_without_wind(draw, even_light) -> None:
    calm = drawn(draw, even_light, Wind(speed_mps=0.0), TIMES_NS[1])
    assert np.array_equal(calm, drawn(draw, even_light, None, TIMES_NS[1]))


def test_equal_seeds_give_equal_pictures_in_any_order(draw, even_light) -> None:
    renderer = draw(even_light(scene()))
    views = [single_instant(CAMERA, T_WORLD_CAMERA, t_ns=t_ns) for t_ns in TIMES_NS]
    forwards = [renderer.radiance(CAMERA, view) for view in views]
    again = draw(even_light(scene()))
    for picture, view in reversed(list(zip(forwards, views, strict=True))):
        assert np.array_equal(picture, again.radiance(CAMERA, view))
    assert not np.array_equal(forwards[0], forwards[1])


def test_shadows_in_the_truth_are_those_of_leaves_at_rest() -> None:
    lamp = PointLight("lamp", np.array([0.0, 0.0, 0.3]), 500.0)
    lit = [replace(scene(wind), lights=(lamp,)) for wind in (None, WIND)]
    shadows = []
    for each in lit:
        shot = CameraShot(T_WORLD_CAMERA, TIMES_NS[1])
        shadows.append(TruthCaster(each).frame(CAMERA, shot, ["shadow", "moving"]))
    calm, windy = shadows
    is_wall = is_inside(
        ~windy.moving & (TruthCaster(lit[0]).frame(CAMERA, CameraShot(T_WORLD_CAMERA, 0), ["depth"]).depth > 5)
    )
    assert calm.shadow[is_wall].any()
    assert np.array_equal(calm.shadow[is_wall], windy.shadow[is_wall])
