"""Faces return no more light than they receive, by Fresnel's law."""

import numpy as np

from tests.rendering.rectangles import rectangle
from vobench.rendering.face_response import Response, response
from vobench.rendering.visibility import Visibility
from vobench.scene.material import LUMINANCE, Material
from vobench.scene.triangles import triangle_table

X, Y, _ = np.eye(3)


def test_a_face_mirrors_and_scatters_no_more_than_all_light() -> None:
    etas = np.array([0.0, 1.3, 1.5, 2.0], np.float32)
    ones = np.ones(4, np.float32)
    lamp = np.full(4, -1, np.int32)
    response = Response(np.ones(4, bool), etas, ones, 0 * ones, 0 * ones, lamp, np.zeros(4, bool))
    face = np.repeat(np.arange(4, dtype=np.int32), 50)
    cosine = np.tile(np.linspace(0.01, 1, 50), 4)
    mirrored, scattered = response.mirrored(face, cosine), response.scattered(face, cosine)
    np.testing.assert_allclose(mirrored + scattered, 1, atol=1e-6)
    assert (mirrored[face == 0] == 0).all()
    by_face = mirrored.reshape(4, 50)
    assert (np.diff(by_face[1:], axis=1) <= 1e-6).all()  # the more grazing, the more is mirrored
    assert (np.diff(by_face[:, -1]) > 0).all()
    metal = Response(np.ones(4, bool), 0 * etas, ones, 0.8 * ones, 0 * ones, lamp, np.zeros(4, bool))
    np.testing.assert_allclose(metal.mirrored(face, cosine), 0.8, rtol=1e-6)


def test_each_face_has_the_properties_of_its_material_and_no_face_has_none() -> None:
    materials = {
        "wax": Material(eta=1.5, tint=0.9, roughness=0.1),
        "brass": Material(colour=(0.9, 0.7, 0.4), metal=0.5),
        "mirror": Material("mirror", tint=0.8),
        "glass": Material("pane", eta=1.5, tint=0.7),
    }
    things = [rectangle(3 * n * X, X, Y, name) for n, name in enumerate(materials)]
    faces = triangle_table(things, [-1] * 4, [-1] * 4)
    optics = response(faces, materials, Visibility(faces, materials, np.arange(len(faces))))
    wax, brass, mirror, glass, none = (0, 2, 4, 6, -1)
    assert optics.scatters[[wax, brass, mirror, glass, none]].tolist() == [True, True, False, False, False]
    np.testing.assert_allclose(optics.eta[[wax, brass, mirror, glass, none]], [1.5, 0, 0, 0, 0])
    np.testing.assert_allclose(optics.tint[[wax, mirror, none]], [0.9, 0, 0])
    np.testing.assert_allclose(optics.metal[[wax, mirror, glass, none]], [0, 0.8, 0, 0])
    np.testing.assert_allclose(optics.metal[brass], 0.5 * np.array([0.9, 0.7, 0.4]) @ LUMINANCE)
    np.testing.assert_allclose(optics.roughness[[wax, brass, none]], [0.1, 0, 0])
    assert (optics.lamp == -1).all()
    assert optics.shows_lamps[[wax, brass, mirror, glass, none]].tolist() == [False, False, True, False, False]
