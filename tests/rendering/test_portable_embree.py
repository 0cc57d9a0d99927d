"""Embree held to one instruction set meets the same triangles, in the same places but for their last bits."""

import numpy as np
import pytest
from embreex.mesh_construction import TriangleMesh

from vobench.portable import PORTABLE
from vobench.rendering.embree import TriangleCaster, new_scene
from vobench.rendering.portable_embree import with_portable_places


@pytest.fixture
def soup():
    """Triangles (K, 3, 3), and rays from amid them."""
    rng = np.random.default_rng(0)
    triangles = 0.3 * rng.normal(size=(500, 3, 3)) + 3 * rng.normal(size=(500, 1, 3))
    origins, directions = rng.normal(size=(2, 4000, 3))
    return tuple(np.ascontiguousarray(each, np.float32) for each in (triangles, origins, directions))


def first_hits(soup, **options):
    triangles, origins, directions = soup
    scene = new_scene(**options)
    mesh = TriangleMesh(scene, triangles)
    hit = scene.run(origins, directions, np.full(len(origins), 1e8, np.float32), query="INTERSECT", output=1)
    del mesh
    return hit


@pytest.mark.parametrize("robust", [False, True])
def test_a_portable_scene_meets_the_triangles_that_any_other_meets(soup, robust, monkeypatch):
    monkeypatch.delenv(PORTABLE, raising=False)
    usual = first_hits(soup, robust=robust)
    monkeypatch.setenv(PORTABLE, "1")
    portable = first_hits(soup, robust=robust)
    assert (usual["primID"] >= 0).sum() > 100
    assert np.array_equal(usual["primID"], portable["primID"])


def test_recomputed_places_are_those_of_embree_and_on_the_ray(soup, monkeypatch):
    triangles, origins, directions = soup
    monkeypatch.setenv(PORTABLE, "1")
    hit = first_hits(soup)
    before = {name: values.copy() for name, values in hit.items()}
    after = with_portable_places(hit, triangles, origins, directions)
    met = after["primID"] >= 0
    for name in ("u", "v", "tfar"):
        np.testing.assert_allclose(after[name][met], before[name][met], rtol=1e-3, atol=1e-4)
        assert np.array_equal(after[name][~met], before[name][~met])
    a, b, c = np.moveaxis(triangles[after["primID"][met]], 1, 0)
    u, v, t = (after[name][met, None] for name in ("u", "v", "tfar"))
    np.testing.assert_allclose((1 - u - v) * a + u * b + v * c, origins[met] + t * directions[met], atol=1e-4)


def test_a_caster_recomputes_places_only_where_they_must_be_portable(soup, monkeypatch):
    triangles, origins, directions = soup
    distances = {}
    for value in ("", "1"):
        monkeypatch.setenv(PORTABLE, value)
        caster = TriangleCaster(triangles, np.arange(len(triangles)), robust=False)
        distances[value] = caster.hits(origins, directions, 1e8).distance
    hit = first_hits(soup)
    recomputed = with_portable_places(hit, triangles, origins, directions)
    met = hit["primID"] >= 0
    np.testing.assert_array_equal(distances["1"][met], recomputed["tfar"][met])
    monkeypatch.setenv(PORTABLE, "")
    np.testing.assert_array_equal(distances[""][met], first_hits(soup)["tfar"][met])
