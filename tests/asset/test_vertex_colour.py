"""Colours of vertices become a texture that shows each corner's colour, and the mean of the corners between them."""

import numpy as np
import pytest

from vobench.asset import vertex_colour
from vobench.asset.gltf_material import Look
from vobench.asset.vertex_colour import painted
from vobench.scene.material import Material, Picture, linear
from vobench.scene.mesh_arrays import MeshArrays

RNG = np.random.default_rng(2)
WEIGHTS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [0.5, 0.5, 0], [1 / 3, 1 / 3, 1 / 3], [0.6, 0.2, 0.2]])


def soup(faces):
    """A mesh of separate triangles."""
    vertices_m = RNG.normal(size=(3 * faces, 3))
    normals = np.tile([0.0, 0.0, 1.0], (3 * faces, 1))
    return MeshArrays(vertices_m, np.arange(3 * faces).reshape(-1, 3), np.zeros((3 * faces, 2)), normals)


def look(**material):
    return Look("paint", Material(**material))


def shown(mesh, picture, weights):
    """The linear colour (F, 3) at a point of each face, with bilinear filtering as on a graphics card."""
    side = len(picture)
    px = (weights @ mesh.uv[mesh.faces]) * side - 0.5
    first = np.clip(np.floor(px).astype(int), 0, side - 2)
    share = px - first
    colour = np.zeros((len(px), 3))
    for right in (0, 1):
        for below in (0, 1):
            weight_u = share[:, 0] if right else 1 - share[:, 0]
            weight_v = share[:, 1] if below else 1 - share[:, 1]
            texel = linear(picture[first[:, 1] + below, first[:, 0] + right])
            colour += (weight_u * weight_v)[:, None] * texel
    return colour


@pytest.mark.parametrize("most_large", [1 << 16, 1])
@pytest.mark.parametrize("faces", [1, 2, 5, 40])
def test_a_face_shows_the_colours_of_its_corners_and_between_them_what_lies_between(monkeypatch, most_large, faces):
    monkeypatch.setattr(vertex_colour, "MOST_LARGE_PATCHES", most_large)
    colours = RNG.uniform(0.1, 0.9, (faces, 3, 3))
    mesh, painted_look = painted(soup(faces), colours, look())
    picture = painted_look.material.texture.pixels()
    for weights in WEIGHTS:
        expected = np.einsum("c,fck->fk", weights, colours)
        np.testing.assert_allclose(shown(mesh, picture, weights), expected, atol=0.015)


def test_all_faces_are_drawn_if_they_are_drawn_in_several_steps(monkeypatch):
    colours = RNG.uniform(0.1, 0.9, (20, 3, 3))
    pictures = []
    for at_once in (65_536, 3):
        monkeypatch.setattr(vertex_colour, "FACES_AT_ONCE", at_once)
        pictures.append(painted(soup(20), colours, look())[1].material.texture.pixels())
    np.testing.assert_array_equal(pictures[0], pictures[1])


def test_faces_of_equal_colours_share_a_patch_and_others_do_not():
    first, second = RNG.uniform(0.1, 0.9, (2, 3, 3))
    mesh, _ = painted(soup(3), np.stack([first, second, first]), look())
    uv = mesh.uv.reshape(3, 3, 2)
    np.testing.assert_array_equal(uv[0], uv[2])
    assert np.abs(uv[0] - uv[1]).max() > 0.1


def test_a_picture_is_a_square_just_large_enough_and_no_corner_is_at_its_border():
    for faces, columns in ((1, 1), (2, 2), (4, 2), (5, 3), (9, 3), (10, 4)):
        mesh, painted_look = painted(soup(faces), RNG.uniform(0.1, 0.9, (faces, 3, 3)), look())
        picture = painted_look.material.texture.pixels()
        assert picture.shape == (8 * columns, 8 * columns, 3)
        texel = 1 / (8 * columns)
        assert texel < mesh.uv.min() < mesh.uv.max() < 1 - texel


def test_the_shape_stays_and_the_first_look_is_not_changed():
    mesh = soup(4)
    first = look(colour=(0.5, 1.0, 0.25), roughness=0.2)
    changed, painted_look = painted(mesh, RNG.uniform(0.1, 0.9, (4, 3, 3)), first)
    for name in ("vertices_m", "faces", "normals"):
        np.testing.assert_array_equal(getattr(changed, name), getattr(mesh, name))
    assert painted_look.material.colour == (0.5, 1.0, 0.25)  # which multiplies the texture
    assert painted_look.material.roughness == 0.2
    assert first.material.texture is None


@pytest.mark.parametrize("difference", [0.0, 0.5 / 255])
def test_equal_colours_multiply_that_of_the_material_without_a_texture(difference):
    mesh = soup(2)
    colours = np.full((2, 3, 3), [0.2, 0.4, 0.8])
    colours[0] += difference / 2
    colours[1] -= difference / 2
    same, painted_look = painted(mesh, colours, look(colour=(0.5, 0.5, 0.25)))
    assert same is mesh
    assert painted_look.material.texture is None
    assert painted_look.material.colour == pytest.approx((0.1, 0.2, 0.2), abs=1e-6)
    assert painted_look.notes == ()


def test_a_difference_of_one_channel_at_one_corner_makes_a_texture():
    colours = np.full((2, 3, 3), 0.4)
    colours[1, 2, 0] += 1.5 / 255
    assert painted(soup(2), colours, look())[1].material.texture is not None


def test_a_texture_is_kept_and_multiplied_by_the_mean_with_a_note():
    texture = Picture(np.full((2, 2, 3), 100, np.uint8))
    colours = np.zeros((2, 3, 3))
    colours[1] = [0.4, 0.6, 1.0]
    mesh = soup(2)
    same, painted_look = painted(mesh, colours, look(texture=texture))
    assert same is mesh
    assert painted_look.material.texture is texture
    assert painted_look.material.colour == pytest.approx((0.2, 0.3, 0.5))
    assert painted_look.notes == ("material 'paint': colours by vertex read as their mean",)
