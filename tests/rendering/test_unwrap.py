"""Every face has a place of its own in the map of light, and what is read there is its own light."""

import sys
import time
import weakref

import numpy as np
import pytest
import trimesh
from trimesh import Trimesh

from vobench.errors import RenderError
from vobench.geometry.se3 import Array
from vobench.geometry.triangle import areas_m2
from vobench.rendering import unwrap as unwrapping
from vobench.rendering.atlas import Atlas
from vobench.rendering.texel import Texels, texels
from vobench.rendering.texel_layout import TexelLayout
from vobench.rendering.texel_owner import owners
from vobench.rendering.unwrap import unwrap
from vobench.scene.material import Material
from vobench.scene.mesh import flat_shaded, joined, make_mesh, quad, two_sided
from vobench.scene.triangles import Thing, Triangles, triangle_table

MATERIALS = {"grey": Material()}


def shape(made: trimesh.Trimesh, *, smooth: bool) -> Trimesh:
    vertices, faces = np.asarray(made.vertices, float), np.asarray(made.faces, np.int32)
    if not smooth:
        return flat_shaded(vertices, faces, vertices[:, :2])
    return make_mesh(vertices, faces, vertices[:, :2].copy(), np.asarray(made.vertex_normals, float))


def zoo() -> Triangles:
    """Floors and boxes, round things, a sheet with a back, faces too thin for a texel, and some without area."""
    sheet = two_sided(quad([3, 0, 0.5], [0.5, 0, 0.2], [0, 0.7, 0]))
    needle = flat_shaded([[0, 3, 0], [1, 3, 0], [0.5, 3.0001, 0]], [[0, 1, 2]], np.zeros((3, 2)))
    nothing = flat_shaded([[0, 0, 0], [2, 0, 0], [1, 0, 0], [2, 1.5, 0]], [[0, 1, 2], [1, 1, 3]], np.zeros((4, 2)))
    meshes = [
        joined([quad([0, 0, 0], [2, 0, 0], [0, 1.5, 0]), nothing]),
        shape(trimesh.creation.box((0.3, 0.5, 0.7)), smooth=False),
        shape(trimesh.creation.icosphere(subdivisions=3, radius=0.3), smooth=True),
        shape(trimesh.creation.torus(0.4, 0.05), smooth=True),
        shape(trimesh.creation.cylinder(0.02, 1.0), smooth=True),
        sheet,
        needle,
    ]
    things = [Thing(f"thing {nth}", mesh, "grey") for nth, mesh in enumerate(meshes)]
    return triangle_table(things, [-1] * len(things), [-1] * len(things))


FACES = zoo()
LIT = np.ones(len(FACES), bool)


def laid_out(spacing_m: float) -> tuple[Atlas, Texels, TexelLayout]:
    atlas = unwrap(FACES, np.full(len(FACES), spacing_m), LIT)
    return atlas, *texels(FACES, MATERIALS, atlas, owners(atlas), among=LIT, seed=0)


@pytest.fixture(params=["xatlas", "axes"])
def _charts(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    if request.param == "axes":
        monkeypatch.setitem(sys.modules, "xatlas", None)


def places() -> tuple[Array, Array, Array]:
    """Places all over all faces that have some area, their corners and edges among them."""
    big = np.flatnonzero(areas_m2(FACES.corners_m) > 1e-6)
    u, v = np.array([(i / 6, j / 6) for i in range(7) for j in range(7 - i)]).T
    return np.repeat(big, len(u)).astype(np.int32), np.tile(u, len(big)), np.tile(v, len(big))


@pytest.mark.usefixtures("_charts")
@pytest.mark.parametrize("spacing_m", [0.02, 0.1, 5.0])
def test_what_a_face_shows_comes_from_its_own_chart_alone(spacing_m: float) -> None:
    atlas, points, layout = laid_out(spacing_m)
    face, u, v = places()
    chart = atlas.read(layout.filled(atlas.chart[points.face].astype(np.float32)), face, u, v)
    np.testing.assert_allclose(chart, atlas.chart[face], atol=1e-3)


@pytest.mark.usefixtures("_charts")
@pytest.mark.parametrize("spacing_m", [0.02, 0.1])
def test_points_lie_where_their_texels_are_shown(spacing_m: float) -> None:
    atlas, points, layout = laid_out(spacing_m)
    face, u, v = places()
    a, b, c = FACES.corners_m[face].swapaxes(0, 1)
    shown = atlas.read(layout.filled(points.points_m), face, u, v)
    error_m = np.linalg.norm(shown - (a + u[:, None] * (b - a) + v[:, None] * (c - a)), axis=1)
    # At a round chart's rim the nearest texel stands for its neighbours.
    assert error_m.max() < 2 * spacing_m
    assert np.median(error_m) < 0.1 * spacing_m
    of_floor = FACES.thing[face] == 0
    assert error_m[of_floor].max() < 3e-3


@pytest.mark.usefixtures("_charts")
@pytest.mark.parametrize("spacing_m", [0.02, 0.1])
def test_samples_are_about_as_far_apart_as_asked(spacing_m: float) -> None:
    _, points, _ = laid_out(spacing_m)
    for steps in (points.step_u_m, points.step_v_m):
        length = np.linalg.norm(steps, axis=1)
        inner = length[(length > 0) & (FACES.thing[points.face] < 2)]
        assert 0.8 * spacing_m < inner.min() <= inner.max() < 1.01 * spacing_m


def test_the_outer_samples_of_a_rectangle_lie_on_its_edges() -> None:
    atlas, _, _ = laid_out(0.1)
    corners = atlas.light_px[:2].reshape(-1, 2)
    np.testing.assert_array_equal(corners % 1, 0.5)
    assert sorted(np.ptp(corners, axis=0).tolist()) == [15, 20]


def test_a_front_and_its_back_have_places_of_their_own() -> None:
    atlas, points, _ = laid_out(0.05)
    front, back = np.flatnonzero(FACES.thing == 5).reshape(2, 2)
    assert not set(atlas.chart[front]) & set(atlas.chart[back])
    assert all((points.face == face).any() for face in (*front, *back))


def test_a_map_is_the_same_bytes_twice() -> None:
    first, again = laid_out(0.05)[0], laid_out(0.05)[0]
    assert first.light_px.tobytes() == again.light_px.tobytes()
    assert first.chart.tobytes() == again.chart.tobytes()


def test_lamps_share_a_block_each_and_what_has_no_light_another() -> None:
    lamp = Thing("lamp", quad([0, 0, 2], [0, 1, 0], [1, 0, 0]), "")
    faces = triangle_table([FACES.things[0], lamp, lamp, FACES.things[5]], [-1] * 4, [-1, 0, 1, -1])
    lit = faces.thing == 0
    atlas = unwrap(faces, np.full(len(faces), 0.1), lit)
    taken = np.zeros((atlas.height, atlas.width), int)
    for first in (np.flatnonzero(faces.thing == nth)[0] for nth in (1, 2, 3)):
        taken[atlas.block(int(first))] += 1
    assert taken.max() == 1
    assert taken.sum() == 27
    assert (taken.ravel()[np.flatnonzero(owners(atlas).face >= 0)] == 0).all()


def test_a_map_too_large_for_memory_is_refused_with_what_would_do() -> None:
    with pytest.raises(RenderError, match="million samples"):
        unwrap(FACES, np.full(len(FACES), 2e-4), LIT)


class Stand:
    """Stands in for an atlas of xatlas."""


def test_an_atlas_of_xatlas_is_destroyed_once_its_threads_are_idle(monkeypatch):
    """Earlier its destructor may wait forever."""
    idle_atlases = unwrapping._IdleAtlases()
    now_s = 100.0
    monkeypatch.setattr(unwrapping.time, "monotonic", lambda: now_s)
    atlas = Stand()
    is_there = weakref.ref(atlas)
    idle_atlases.keep(atlas)
    del atlas

    now_s += unwrapping.IDLE_S
    idle_atlases.keep(Stand())
    assert is_there()
    now_s += 0.1
    idle_atlases.keep(Stand())
    assert is_there() is None


def test_an_atlas_of_xatlas_outlives_the_end_of_the_process():
    atlas = Stand()
    before = sys.getrefcount(atlas)
    idle_atlases = unwrapping._IdleAtlases()
    idle_atlases.keep(atlas)
    del idle_atlases
    assert sys.getrefcount(atlas) == before + 1


def test_a_process_that_unwraps_many_scenes_keeps_the_atlas_of_one(monkeypatch):
    pytest.importorskip("xatlas")
    monkeypatch.setattr(unwrapping, "IDLE_S", 0.5)
    spacing_m = np.full(len(FACES), 0.05)
    kept_counts = []
    for _ in range(3):
        unwrap(FACES, spacing_m, LIT)
        time.sleep(0.6)
        kept_counts.append(len(unwrapping._IDLE_ATLASES._kept))
    assert kept_counts[1:] == [1, 1]
