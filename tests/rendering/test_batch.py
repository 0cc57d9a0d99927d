"""All that a table of faces shows is drawn once, each face by the batch of its material, mover and mirror."""

import numpy as np
import pytest

from tests.rendering.rectangles import box, room
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering.batch import VERTEX_FLOATS, Batch, Geometry, depends_on_view, geometry
from vobench.scene.material import Material
from vobench.scene.triangles import Triangles, triangle_table

MATERIALS = {
    "plain": Material(),
    "wax": Material(eta=1.5, roughness=0.2),
    "mirror": Material("mirror"),
    "glass": Material("pane", eta=1.5),
}
SIDES = room((4, 5, 3), floor="mirror", wall="plain", ceiling="wax")
CART = box(np.array([0.5, 0.2, 0.4]), (0.4, 0.5, 0.6), yaw_deg=20, material="wax")
FACES = triangle_table([*SIDES, *CART], [-1] * len(SIDES) + [0] * len(CART), [-1] * (len(SIDES) + len(CART)))


def drawn(faces: Triangles) -> Geometry:
    return geometry(faces, np.zeros((len(faces), 3, 2), np.float32), MATERIALS)


def corners_m(scene: Geometry) -> Array:
    """The triangles (T, 3, 3) that are drawn."""
    return scene.vertices[scene.indices, :3].reshape(-1, 3, 3).astype(float)


def test_the_area_of_every_batch_is_drawn_and_all_of_the_faces_with_them() -> None:
    scene = drawn(FACES)
    area_m2 = areas_m2(corners_m(scene))
    batch = np.repeat(scene.clusters.batch, scene.clusters.count // 3)
    np.testing.assert_allclose(np.bincount(batch, area_m2), [each.area_m2 for each in scene.batches], rtol=1e-5)
    assert area_m2.sum() == pytest.approx(areas_m2(FACES.corners_m).sum(), rel=1e-6)


def test_clusters_follow_each_other_in_the_indices_and_hold_their_corners() -> None:
    scene = drawn(FACES)
    clusters = scene.clusters
    assert clusters.first[0] == 0
    np.testing.assert_array_equal(clusters.first[1:], clusters.first[:-1] + clusters.count[:-1])
    assert clusters.first[-1] + clusters.count[-1] == len(scene.indices)
    for low_m, high_m, first, count in zip(
        clusters.low_m, clusters.high_m, clusters.first, clusters.count, strict=True
    ):
        points_m = scene.vertices[scene.indices[first : first + count], :3]
        np.testing.assert_allclose(points_m.min(0), low_m, atol=1e-6)
        np.testing.assert_allclose(points_m.max(0), high_m, atol=1e-6)


def test_batches_differ_in_material_mover_or_mirror_and_the_mirror_has_its_own() -> None:
    scene = drawn(FACES)
    kinds = [(id(each.material), each.mover, each.mirror and each.mirror.index) for each in scene.batches]
    assert len(set(kinds)) == len(kinds) == 4
    (mirrored,) = [each for each in scene.batches if each.mirror is not None]
    assert mirrored.material is MATERIALS["mirror"]
    assert [each.index for each in scene.batches] == [0, 1, 2, 3]
    assert {each.mover for each in scene.batches} == {-1, 0}


def test_vertices_are_distinct_and_only_gloss_without_a_mirror_has_normals() -> None:
    scene = drawn(FACES)
    assert scene.vertices.shape[1] == VERTEX_FLOATS
    assert len(np.unique(scene.vertices, axis=0)) == len(scene.vertices)
    batch = np.repeat(scene.clusters.batch, scene.clusters.count)
    has_normal = np.linalg.norm(scene.vertices[scene.indices, 3:6], axis=1) > 0.5
    needs = np.array([each.has_gloss and each.mirror is None for each in scene.batches])
    np.testing.assert_array_equal(has_normal, needs[batch])


def test_the_same_faces_give_the_same_bytes() -> None:
    one, other = drawn(FACES), drawn(FACES)
    assert one.vertices.tobytes() == other.vertices.tobytes()
    assert one.indices.tobytes() == other.indices.tobytes()


def test_a_lamp_is_neither_a_pane_nor_glossy_whatever_it_names() -> None:
    lamp = Batch(0, MATERIALS["glass"], -1, None, is_lamp=True, area_m2=1.0)
    pane = Batch(0, MATERIALS["glass"], -1, None, is_lamp=False, area_m2=1.0)
    assert (lamp.is_pane, lamp.has_gloss) == (False, False)
    assert (pane.is_pane, pane.has_gloss) == (True, True)


@pytest.mark.parametrize(
    ("material", "depends"),
    [
        (Material(), False),
        (Material(eta=1.5), True),
        (Material(metal=0.1), True),
        (Material("mirror"), True),
        (Material("pane", eta=1.5), True),
    ],
)
def test_what_mirrors_depends_on_the_view(material: Material, depends: bool) -> None:
    assert depends_on_view(material) is depends
