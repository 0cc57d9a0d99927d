"""Holes in faces: where a texture's opacity is below the cut-out, interpolated and repeated."""

import gc
import weakref

import numpy as np

from vobench.rendering.cutout import CutOuts, is_opaque
from vobench.rendering.embree import Hits
from vobench.scene.material import Material, Picture
from vobench.scene.mesh import quad
from vobench.scene.triangles import Thing, triangle_table

PIXELS = np.full((8, 16, 4), 255, np.uint8)
PIXELS[:, 8:, 3] = 0  # the right half is a hole
LEAF = Material(texture=Picture(PIXELS, 0.5), cutout=0.5)
RNG = np.random.default_rng(0)


def test_solid_and_hole_are_told_apart_in_the_middle_of_each_half() -> None:
    places = np.array([[0.25, 0.3], [0.75, 0.6]])
    assert is_opaque(LEAF, places).tolist() == [True, False]


def test_a_texture_repeats_in_every_direction() -> None:
    places = RNG.uniform(0.02, 0.98, (500, 2))
    shifts = RNG.integers(-5, 6, (500, 2))
    far_from_edge = np.abs((places[:, 0] * 2) % 1 - 0.5) < 0.45
    shifted = is_opaque(LEAF, places + shifts)
    np.testing.assert_array_equal(shifted[far_from_edge], is_opaque(LEAF, places)[far_from_edge])


def test_opacity_is_linear_between_pixels() -> None:
    """Half-way between the last solid pixel and the first hole it is one half."""
    edge = 8 / 16
    places = np.array([[edge - 1e-3, 0.5], [edge + 1e-3, 0.5]])
    assert is_opaque(LEAF, places).tolist() == [True, False]
    strict = Material(texture=Picture(PIXELS, 0.5), cutout=0.75)
    # Opacity falls to three quarters a quarter of a pixel before the edge.
    places = np.array([[edge - 0.26 / 16, 0.5], [edge - 0.24 / 16, 0.5]])
    assert is_opaque(strict, places).tolist() == [True, False]


def test_the_pixels_of_a_material_are_freed_with_it() -> None:
    pixels = PIXELS.copy()
    leaf = Material(texture=Picture(pixels, 0.5), cutout=0.5)
    freed = weakref.ref(pixels)
    assert is_opaque(leaf, np.array([[0.25, 0.3]])).all()
    del pixels, leaf
    gc.collect()
    assert freed() is None


def test_holes_are_found_on_faces_of_that_material_alone() -> None:
    things = [Thing("leaf", quad([0, 0, 0], [1, 0, 0], [0, 1, 0]), "leaf")]
    things.append(Thing("wall", quad([0, 0, 1], [1, 0, 0], [0, 1, 0]), "wall"))
    faces = triangle_table(things, [-1, -1], [-1, -1])
    cut_outs = CutOuts(faces, {"leaf": LEAF, "wall": Material()})
    assert cut_outs.cutout_of_face.tolist() == [0, 0, -1, -1, -1]
    weights = RNG.dirichlet(np.ones(3), 400)
    face = RNG.integers(0, 4, 400).astype(np.int32)
    hits = Hits(face, weights[:, 1], weights[:, 2], np.ones(400))
    uv = hits.at(faces.uv)
    is_hole = cut_outs.are_in_holes(hits)
    phase = uv[:, 0] / LEAF.tile_m % 1
    clear = np.abs(phase % 0.5 - 0.25) < 0.2
    np.testing.assert_array_equal(is_hole[clear], ((face < 2) & (phase > 0.5))[clear])
    assert is_hole.any()
    nothing = Hits(np.full(1, -1, np.int32), np.zeros(1), np.zeros(1), np.full(1, np.nan))
    assert not cut_outs.are_in_holes(nothing).any()
