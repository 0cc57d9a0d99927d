"""Points of the light map: off their faces, with steps from texel to texel, and none inside things."""

import numpy as np
import pytest
import trimesh

from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.rendering.visibility import Visibility
from vobench.scene.material import Material, fresnel
from vobench.scene.mesh import flat_shaded, make_mesh, quad, two_sided
from vobench.scene.triangles import Thing, Triangles, triangle_table

MATERIALS = {"grey": Material(), "wax": Material(eta=1.5)}
BOARD = triangle_table([Thing("board", quad([1, 2, 3], [0.7, 0, 0], [0, 0.5, 0]), "wax")], [-1], [-1])


def points_of(faces: Triangles, spacing_m: float, *, seed: int = 0) -> tuple[Texels, TexelLayout]:
    lit = np.ones(len(faces), bool)
    atlas = unwrap(faces, np.full(len(faces), spacing_m), lit)
    return texels(faces, MATERIALS, atlas, owners(atlas), among=lit, seed=seed)


def shape(made: trimesh.Trimesh, *, smooth: bool) -> trimesh.Trimesh:
    vertices, faces = np.asarray(made.vertices, float), np.asarray(made.faces, np.int32)
    if not smooth:
        return flat_shaded(vertices, faces, vertices[:, :2])
    return make_mesh(vertices, faces, vertices[:, :2].copy(), np.asarray(made.vertex_normals, float))


def test_a_step_leads_from_each_inner_point_to_the_next() -> None:
    points, layout = points_of(BOARD, 0.05)
    inner = np.flatnonzero((layout.neighbours != np.arange(len(points))).all(0))
    assert len(inner) > 50
    for side, step_m in ((1, points.step_u_m), (3, points.step_v_m)):
        after = layout.neighbours[side][inner]
        deep = inner[np.isin(after, inner)]
        after = layout.neighbours[side][deep]
        np.testing.assert_allclose(points.points_m[after] - points.points_m[deep], step_m[deep], atol=1e-5)


def test_points_lie_off_their_face_by_less_than_a_millimetre_and_steps_end_at_rims() -> None:
    points, layout = points_of(BOARD, 0.05)
    height_m = points.points_m[:, 2] - 3
    assert (height_m > 5e-5).all()
    assert (height_m < 1e-3).all()
    at_rim = layout.neighbours[0] == np.arange(len(points))
    assert at_rim.any()
    assert (points.step_u_m[at_rim] == 0).all()
    np.testing.assert_allclose(points.planes, np.tile([0, 0, 1], (len(points), 1)), atol=1e-7)


def test_a_coat_lets_in_what_it_does_not_reflect_and_light_from_behind_has_no_cosine() -> None:
    points, _ = points_of(BOARD, 0.1)
    np.testing.assert_allclose(points.eta, 1.5)
    angle = 0.7
    above = np.tile([np.sin(angle), 0, np.cos(angle)], (len(points), 1)) * 3
    cosine = points.cosine(above)
    np.testing.assert_allclose(cosine, np.cos(angle), rtol=1e-6)
    np.testing.assert_allclose(points.entering(cosine), 1 - fresnel(np.array(np.cos(angle)), 1.5), rtol=1e-5)
    assert (points.cosine(-above) == 0).all()


def test_the_seed_turns_the_pattern_of_rays_and_nothing_else() -> None:
    one, other = points_of(BOARD, 0.1, seed=1)[0], points_of(BOARD, 0.1, seed=2)[0]
    np.testing.assert_array_equal(one.points_m, other.points_m)
    assert (one.dither != other.dither).any()
    assert (one.dither >= 0).all()
    assert (one.dither < 1).all()


def test_where_things_touch_neither_side_has_light_of_its_own():
    """The bottom of a box on a floor is beyond it, in the open sky for all that rays tell."""
    floor = quad([-1, -1, 0], [2, 0, 0], [0, 2, 0])
    meshes = {
        "floor": floor,
        "standing": shape(
            trimesh.creation.box((0.2, 0.2, 0.2), trimesh.transformations.translation_matrix([0, 0, 0.1])), smooth=False
        ),
        "raised": shape(
            trimesh.creation.box((0.2, 0.2, 0.2), trimesh.transformations.translation_matrix([0.5, 0, 0.12])),
            smooth=False,
        ),
        "sheet": two_sided(quad([-0.6, 0, 0.3], [0.2, 0, 0], [0, 0.2, 0])),
    }
    things = [Thing(name, mesh, "grey") for name, mesh in meshes.items()]
    faces = triangle_table(things, [-1] * len(things), [-1] * len(things))
    lit = np.ones(len(faces), bool)
    atlas = unwrap(faces, np.full(len(faces), 0.025), lit)
    visibility = Visibility(faces, MATERIALS, np.arange(len(faces)))
    points, _ = texels(faces, MATERIALS, atlas, owners(atlas), among=lit, seed=0, visibility=visibility)
    name = np.array(list(meshes))[faces.thing[points.face]]
    down, up = points.planes[:, 2] < -0.9, points.planes[:, 2] > 0.9
    assert not (down & (name == "standing")).any()
    assert (up & (name == "standing")).sum() == pytest.approx(64, rel=0.4)
    assert (down & (name == "raised")).sum() == pytest.approx(64, rel=0.4)
    assert (down & (name == "sheet")).sum() == (up & (name == "sheet")).sum() > 30
    x, y, _ = points.points_m[name == "floor"].T
    assert not ((np.abs(x) < 0.09) & (np.abs(y) < 0.09)).any()
    assert ((np.abs(x - 0.5) < 0.09) & (np.abs(y) < 0.09)).sum() > 30
