"""Leaves in wind: which faces move, about which points, and that they move as rigid bodies."""

from dataclasses import replace

import numpy as np
import pytest

from vobench.asset.branching_tree import branching_tree
from vobench.asset.conifer import conifer
from vobench.asset.outdoors import bush, tree
from vobench.asset.room import things
from vobench.asset.shape import at, block
from vobench.geometry import se3
from vobench.scene.scene import Mover, Scene, WaypointMotion, triangles
from vobench.scene.swaying import SECTORS, in_wind
from vobench.scene.triangles import Thing
from vobench.scene.wind import Wind

WIND = Wind(speed_mps=10.0, towards_deg=30.0)
T_WORLD_OTHER = at(9.0, 2.0, 1.0)


def grove(wind: Wind | None = WIND) -> Scene:
    """A stationary box, three trees, a bush, and a box that moves."""
    rng = np.random.default_rng(4)
    instances = [
        ("oak", branching_tree(rng)),
        ("fir", [part.moved(T_WORLD_OTHER) for part in conifer(rng)]),
        ("elm", [part.moved(at(-9.0, 0, 0)) for part in tree(rng)]),
        ("bush", [part.moved(at(0, 6.0, 0)) for part in bush(rng)]),
    ]
    grown, materials = things(instances)
    box = Thing("box", block((1, 1, 1), bevel_m=0), next(iter(materials)))
    path = WaypointMotion(np.array([0.0, 1.0]), np.zeros((2, 3)), np.zeros(2))
    return Scene("grove", (box, *grown), materials, (), (Mover("cart", (box,), path),), wind=wind)


def foliage(scene: Scene) -> np.ndarray:
    """Which faces (F,) are leaves."""
    faces = triangles(scene)
    return np.array([scene.materials[thing.material].is_foliage for thing in faces.things])[faces.thing]


def test_leaves_move_and_nothing_else_does() -> None:
    scene = grove()
    faces = triangles(scene)
    moving = in_wind(scene, faces)
    is_leaf = foliage(scene)
    assert 0.3 < is_leaf.mean() < 0.99
    assert (moving.faces.mover[is_leaf] > 0).all()
    assert np.array_equal(moving.faces.mover[~is_leaf], faces.mover[~is_leaf])
    assert moving.movers[: len(scene.movers)] == scene.movers
    names = [faces.things[thing].name for thing in faces.thing[is_leaf]]
    assert [moving.movers[mover].name for mover in moving.faces.mover[is_leaf]] == names


@pytest.mark.parametrize("wind", [None, Wind(speed_mps=0.0)], ids=["none", "calm"])
def test_without_wind_the_faces_are_unchanged(wind: Wind | None) -> None:
    scene = grove(wind)
    faces = triangles(scene)
    assert in_wind(scene, faces).faces is faces
    assert in_wind(scene, faces).movers == scene.movers


def test_every_mover_has_faces_and_a_spray_is_not_divided() -> None:
    scene = grove()
    moving = in_wind(scene, triangles(scene))
    mover = moving.faces.mover
    assert set(np.unique(mover[mover >= 0])) == set(range(len(moving.movers)))
    corners = np.rint(moving.faces.corners_m[foliage(scene)] * 1e5).astype(np.int64)
    mover_of_corner: dict[tuple[int, ...], int] = {}
    for face_corners, index in zip(corners.tolist(), mover[foliage(scene)].tolist(), strict=True):
        for corner in face_corners:
            assert mover_of_corner.setdefault(tuple(corner), index) == index


def test_a_crown_has_several_branches_and_a_bush_is_one() -> None:
    scene = grove()
    moving = in_wind(scene, triangles(scene))
    counts = {name: [mover.name for mover in moving.movers].count(name) for name in ("oak", "fir", "elm", "bush")}
    assert counts["bush"] == 1
    assert all(counts[name] >= SECTORS for name in ("oak", "fir", "elm"))


def test_branches_turn_about_their_bases_on_the_axis_of_the_crown() -> None:
    scene = grove()
    moving = in_wind(scene, triangles(scene))
    for index, mover in enumerate(moving.movers[1:], start=1):
        motion = mover.path
        corners_m = moving.faces.corners_m[moving.faces.mover == index].reshape(-1, 3)
        T = motion.pose(1_234_567_890)
        assert se3.is_rotation(T[:3, :3])
        assert se3.apply(T, motion.base_m[None])[0] == pytest.approx(motion.base_m)
        assert motion.base_m[2] == pytest.approx(corners_m[:, 2].min())


def test_the_mean_displacement_is_along_the_wind() -> None:
    scene = grove()
    moving = in_wind(scene, triangles(scene))
    for mover in moving.movers[1:]:
        above_m = mover.path.base_m + np.array([0, 0, 2.0])
        times_ns = np.random.default_rng(0).uniform(0, 4e12, 2000)
        displaced_m = np.array([se3.apply(mover.path.pose(t_ns), above_m[None])[0] - above_m for t_ns in times_ns])
        mean_m = displaced_m.mean(0)
        assert mean_m @ WIND.towards == pytest.approx(2.0 * WIND.deflection_rad, rel=0.15)
        assert abs(np.cross(WIND.towards, mean_m)[2]) < 0.2 * 2.0 * WIND.deflection_rad


def test_a_scene_of_twice_the_size_sways_about_bases_twice_as_far_away() -> None:
    motion = in_wind(grove(), triangles(grove())).movers[-1].path
    sized = motion.sized(2.0)
    assert sized.base_m == pytest.approx(2 * motion.base_m)
    assert sized.pose(10**9)[:3, :3] == pytest.approx(motion.pose(10**9)[:3, :3])


def test_another_seed_sways_otherwise_and_the_same_seed_alike() -> None:
    def pose(wind: Wind) -> np.ndarray:
        scene = grove(wind)
        return in_wind(scene, triangles(scene)).movers[-1].path.pose(3 * 10**9)

    assert np.array_equal(pose(WIND), pose(WIND))
    assert not np.allclose(pose(WIND), pose(replace(WIND, seed=1)))
