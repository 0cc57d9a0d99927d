"""Bodies consist of consecutive movers of one name, and a few triangles cast their shadows."""

import numpy as np
import pytest

from vobench.asset.shape import at, block
from vobench.geometry.triangle import areas_m2
from vobench.rendering.geometry import RayCaster
from vobench.rendering.moving_body import MOST_PROBES, MovingBody, moving_bodies, occluder
from vobench.scene.material import Material
from vobench.scene.mesh import moved, quad
from vobench.scene.scene import Mover, Scene, WaypointMotion, triangles
from vobench.scene.triangles import Thing, triangle_table

PILLAR = moved(block((0.5, 0.3, 1.8), bevel_m=0), at(0.4, -0.2, 0.9, yaw=25))
SPECK = moved(block((0.01, 0.01, 0.01), bevel_m=0), at(0.4, -0.2, 2.0))
FLOOR = quad((-2, -2, 0), (4, 0, 0), (0, 4, 0))


def test_a_convex_thing_casts_the_shade_of_its_hull_and_a_sheet_its_own() -> None:
    hull = occluder(PILLAR.triangles)
    assert len(hull) == 12
    assert np.ptp(hull.reshape(-1, 3), axis=0) == pytest.approx(np.ptp(PILLAR.triangles.reshape(-1, 3), axis=0))
    np.testing.assert_allclose(np.sort(areas_m2(occluder(FLOOR.triangles))), areas_m2(FLOOR.triangles))


def test_a_shape_that_its_hull_would_fill_keeps_its_gap() -> None:
    """Two pillars of one thing: a hull would close what is between them."""
    pair = np.concatenate([PILLAR.triangles, PILLAR.triangles + np.array([2.0, 0, 0])])
    caster = RayCaster(triangle_table([Thing("pair", PILLAR, "grey")], [-1], [-1]))
    assert caster.occluded(np.array([[0.4, -5, 1.0]]), np.array([[0.4, 5, 1.0]])).all()
    middles = occluder(pair).mean(1)
    assert not ((middles[:, 0] > 0.9) & (middles[:, 0] < 1.9)).any()


def bodies_of(*movers: tuple[str, Thing]) -> list[MovingBody]:
    """The bodies of movers with these names, which move along x."""
    motion = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0], [1, 0, 0]]), np.zeros(2))
    scene_movers = tuple(Mover(name, (thing,), motion) for name, thing in movers)
    faces = triangles(Scene("scene", (), {"grey": Material()}, (), scene_movers))
    return moving_bodies(scene_movers, faces, np.ones(len(faces), bool))


def test_consecutive_movers_of_one_name_are_one_body_without_its_specks() -> None:
    pillar = Thing("pillar", PILLAR, "grey")
    speck = Thing("speck", SPECK, "grey")
    first, second = bodies_of(("a", pillar), ("a", speck), ("b", pillar))
    assert (first.movers, second.movers) == ((0, 1), (2,))
    assert set(first.mover) == {0}
    assert len(first.corners_m) == len(second.corners_m)


def test_probes_lie_along_the_longest_axis_and_each_triangle_belongs_to_the_nearest() -> None:
    (body,) = bodies_of(("a", Thing("pillar", PILLAR, "grey")))
    assert 1 < len(body.probes_m) <= MOST_PROBES
    np.testing.assert_allclose(body.probe_place(body.probes_m), np.arange(len(body.probes_m)), atol=1e-9)
    assert np.ptp(body.probes_m[:, 2]) > np.ptp(body.probes_m[:, :2])
    assert set(body.part) <= set(range(len(body.probes_m)))


def test_a_body_is_placed_by_the_poses_of_its_movers() -> None:
    (body,) = bodies_of(("a", Thing("pillar", PILLAR, "grey")))
    T = np.eye(4)[None].copy()
    offset_m = np.array([1.0, 2.0, 3.0])
    T[0, :3, 3] = offset_m
    np.testing.assert_allclose(body.placed(T), body.corners_m + offset_m)
