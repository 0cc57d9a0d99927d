"""A scene's table has every face once, with what its thing, lamp or mover gives it."""

import numpy as np

from vobench.asset.shape import block
from vobench.geometry import se3
from vobench.geometry.triangle import face_normals
from vobench.scene.light import PointLight
from vobench.scene.mesh import quad
from vobench.scene.scene import Mover, Scene, WaypointMotion, ceiling_light, triangles
from vobench.scene.triangles import Thing, triangle_table


def hall() -> Scene:
    crate = Thing("crate", block((1, 1, 1), bevel_m=0), "wood")
    lid = Thing("lid", quad([0, 0, 0.6], [1, 0, 0], [0, 1, 0]), "wood")
    path = WaypointMotion(np.array([0.0, 1.0]), np.array([[0.0, 0, 0.5], [1.0, 0, 0.5]]), np.array([0.0, 90.0]))
    floor = Thing("floor", quad([-2, -3, 0], [4, 0, 0], [0, 6, 0]), "f")
    bulb = PointLight("bulb", np.zeros(3), 1.0)
    lamp = ceiling_light("lamp", np.array([0.0, 0.0, 2.9]), (0.5, 0.5), power_lm=1.0)
    mover = Mover("crate", (crate, lid), path)
    return Scene("hall", (floor, Thing("pyramid", block((1, 2, 3), bevel_m=0), "stone")), {}, (bulb, lamp), (mover,))


def test_a_scenes_table_has_what_stands_then_lamps_then_movers() -> None:
    faces = triangles(hall())
    assert [thing.name for thing in faces.things] == ["floor", "pyramid", "lamp", "crate", "lid"]
    assert np.bincount(faces.thing).tolist() == [2, 12, 2, 12, 2]
    assert (np.diff(faces.thing) >= 0).all()
    assert np.unique(faces.lamp[faces.thing == 2]).tolist() == [1]  # the second of its lights
    assert (faces.lamp[faces.thing != 2] == -1).all()
    assert (faces.mover[-14:] == 0).all()
    assert (faces.mover[:-14] == -1).all()


def test_what_a_face_has_is_that_of_its_things_mesh() -> None:
    faces = triangles(hall())
    for nth, thing in enumerate(faces.things):
        own, mesh = faces.thing == nth, thing.mesh
        np.testing.assert_array_equal(faces.corners_m[own], mesh.triangles)
        np.testing.assert_array_equal(faces.normals[own], mesh.vertex_normals[mesh.faces])
        np.testing.assert_array_equal(faces.uv[own], mesh.visual.uv[mesh.faces])
        np.testing.assert_allclose(faces.plane[own], face_normals(mesh.triangles), atol=1e-12)


def test_movers_faces_are_where_their_path_says_and_others_stay() -> None:
    still, later = triangles(hall()), triangles(hall(), t_ns=1_000_000_000)
    own = still.mover == 0
    pose = hall().movers[0].path.pose(1_000_000_000)
    np.testing.assert_allclose(later.corners_m[own], se3.apply(pose, still.corners_m[own]))
    np.testing.assert_allclose(later.plane[own], face_normals(later.corners_m[own]), atol=1e-12)
    np.testing.assert_array_equal(later.corners_m[~own], still.corners_m[~own])


def test_a_table_of_nothing_is_empty() -> None:
    assert len(triangle_table((), (), ())) == 0
