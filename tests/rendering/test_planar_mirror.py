"""Which faces mirror as one plane, whatever their order and cut, and the rectangle around them."""

import numpy as np
import pytest

from vobench.geometry import se3
from vobench.geometry.triangle import areas_m2, face_normals
from vobench.rendering.planar_mirror import LEAST_M2, MirrorFaces, planar_mirrors, sharpness
from vobench.scene.material import Material, fresnel
from vobench.scene.mesh_arrays import MeshArrays
from vobench.scene.mesh_arrays import quad_arrays as quad

RNG = np.random.default_rng(0)


def faces_of(*meshes: tuple[MeshArrays, int, bool]) -> MirrorFaces:
    """Perfect mirrors, each with its mover and whether it is a pane."""
    corners_m = np.concatenate([mesh.corners_m for mesh, _, _ in meshes])
    counts = [len(mesh.faces) for mesh, _, _ in meshes]
    return MirrorFaces(
        corners_m=corners_m,
        normals=face_normals(corners_m),
        area_m2=areas_m2(corners_m),
        mover=np.repeat([mover for _, mover, _ in meshes], counts),
        strength=np.ones(len(corners_m)),
        is_pane=np.repeat([is_pane for _, _, is_pane in meshes], counts),
    )


WALL = quad([0, 0, 0], [2, 0, 0], [0, 0, 1])
BESIDE = quad([2.5, 0, 0], [1, 0, 0], [0, 0, 1])
FLOOR = quad([0, 0, 0], [3, 0, 0], [0, 3, 0])


def test_faces_of_one_plane_are_one_mirror_and_the_largest_comes_first() -> None:
    index, mirrors = planar_mirrors(faces_of((WALL, -1, False), (BESIDE, -1, False), (FLOOR, -1, False)))
    assert index.tolist() == [1, 1, 1, 1, 0, 0]
    assert [mirror.index for mirror in mirrors] == [0, 1]
    np.testing.assert_allclose(mirrors[0].plane.normal, [0, 0, 1], atol=1e-12)


def test_movers_and_panes_are_mirrors_of_their_own() -> None:
    index, mirrors = planar_mirrors(faces_of((WALL, -1, False), (BESIDE, 0, False), (BESIDE, -1, True)))
    assert len(set(index.tolist())) == 3
    assert {(mirror.mover, mirror.is_pane) for mirror in mirrors} == {(-1, False), (0, False), (-1, True)}


@pytest.mark.parametrize(("is_pane", "count"), [(True, 1), (False, 2)])
def test_both_sides_of_a_pane_are_one_plane_and_those_of_a_mirror_are_two(is_pane: bool, count: int) -> None:
    _, mirrors = planar_mirrors(faces_of((WALL, -1, is_pane), (WALL.flipped(), -1, is_pane)))
    assert len(mirrors) == count


def test_the_outline_is_the_rectangle_however_it_is_turned() -> None:
    for _ in range(5):
        axis = RNG.normal(size=3)
        R = np.linalg.qr(np.stack([axis, *RNG.normal(size=(2, 3))], 1))[0]
        R *= np.sign(np.linalg.det(R))
        T = se3.transform(R, RNG.normal(size=3))
        _, (mirror,) = planar_mirrors(faces_of((WALL.moved(T), -1, False)))
        sides_m = np.linalg.norm(np.roll(mirror.outline_m, -1, axis=0) - mirror.outline_m, axis=1)
        assert sorted(sides_m.round(9).tolist()) == [1, 1, 2, 2]
        heights = mirror.outline_m @ mirror.plane.normal + mirror.plane.offset_m
        np.testing.assert_allclose(heights, 0, atol=1e-9)


def test_what_is_too_small_or_does_not_mirror_is_none() -> None:
    edge = np.sqrt(LEAST_M2)
    small = quad([0, 0, 0], [0.9 * edge, 0, 0], [0, 0, 0.9 * edge])
    large = quad([0, 0, 0], [1.1 * edge, 0, 0], [0, 0, 1.1 * edge])
    assert planar_mirrors(faces_of((small, -1, False)))[0].tolist() == [-1, -1]
    assert planar_mirrors(faces_of((large, -1, False)))[0].tolist() == [0, 0]


def test_a_rim_whose_rectangle_is_mostly_empty_is_no_mirror() -> None:
    bars = [quad([x, 0, 0], [0.01, 0, 0], [0, 0, 8.0]) for x in (0.0, 10.0)]
    index, _ = planar_mirrors(faces_of(*((bar, -1, False) for bar in bars)))
    assert index.tolist() == [-1] * 4


def test_sharpness_is_that_of_a_mirror_a_coat_or_metal_and_none_where_rough() -> None:
    assert sharpness(Material("mirror", tint=0.8)) == 1
    assert sharpness(Material("mirror", tint=0.8, roughness=0.1)) == 0
    assert sharpness(Material()) == 0
    assert sharpness(Material(eta=1.5)) == pytest.approx(float(fresnel(np.array(0.5), 1.5)))
    assert sharpness(Material(metal=0.7)) == 0.7
    assert 0 < sharpness(Material("pane", eta=1.5)) < 0.2
