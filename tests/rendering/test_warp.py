"""A lens put together of pinhole faces shows what its rays see."""

import numpy as np
import pytest

from vobench.geometry.camera import Camera, KannalaBrandt, Pinhole, pixel_grid
from vobench.geometry.se3 import Array
from vobench.rendering.warp import FACES, POINTS, warp

NARROW = KannalaBrandt(60, 40, 70.0, 70.0, 29.5, 19.5, 0.01, 0.0, 0.0, 0.0)
WIDE = KannalaBrandt(60, 60, 20.0, 20.0, 29.5, 29.5, 0.0, 0.0, 0.0, 0.0)
LENSES = pytest.mark.parametrize("lens", [NARROW, WIDE], ids=["narrow", "wide"])


def brightness(directions: Array) -> Array:
    """Something smooth of each direction (..., 3)."""
    unit = directions / np.linalg.norm(directions, axis=-1, keepdims=True)
    return 5 + unit @ [1.0, -2.0, 0.7] + (unit @ [0.3, 0.5, 1.0]) ** 2


def shown(lens: Camera, rows: slice) -> Array:
    """Rows of the lens's picture, of which each face was drawn only where it is needed for them."""
    faces = warp(lens)
    atlas = faces.blank(1)
    atlas[:] = np.nan
    for face in faces.faces:
        box = face.needed_for(rows)
        if box is None:
            continue
        first, end, top, bottom = box
        rays = face.camera.rays(pixel_grid(face.camera)) @ face.R_camera_face.T
        faces.put(atlas, face, box, brightness(rays)[top:bottom, first:end])
    return faces.picture(atlas, rows)


@LENSES
def test_a_lens_shows_the_mean_over_each_of_its_pixels(lens: Camera) -> None:
    picture = shown(lens, slice(0, lens.height_px))
    steps = (np.arange(POINTS) + 0.5) / POINTS - 0.5
    offsets = np.stack(np.meshgrid(steps, steps), -1).reshape(-1, 2)
    expected = np.mean([brightness(lens.rays(pixel_grid(lens) + offset)) for offset in offsets], axis=0)
    inside = np.isfinite(expected)
    assert inside.sum() > 1000
    np.testing.assert_allclose(picture[inside], expected[inside], atol=2e-3)


@LENSES
def test_strips_are_rows_of_the_whole_picture(lens: Camera) -> None:
    whole = shown(lens, slice(0, lens.height_px))
    for rows in (slice(0, 7), slice(7, 30), slice(30, lens.height_px)):
        np.testing.assert_array_equal(shown(lens, rows), whole[rows])


def test_a_narrow_lens_has_one_face_and_a_wide_one_has_faces_in_all_directions_it_sees() -> None:
    assert len(warp(NARROW).faces) == 1
    assert len(warp(WIDE).faces) == 5
    for axes in FACES:
        np.testing.assert_allclose(axes @ axes.T, np.eye(3), atol=1e-12)
        assert np.linalg.det(axes) == pytest.approx(1)


def test_faces_lie_below_one_another_in_the_atlas_and_are_pinholes_with_one_focal_length() -> None:
    faces = warp(WIDE).faces
    ends = np.cumsum([face.camera.height_px for face in faces]).tolist()
    assert [face.row for face in faces] == [0, *ends[:-1]]
    assert {(face.camera.fx_px, face.camera.fy_px) for face in faces} == {(faces[0].camera.fx_px,) * 2}
    assert all(isinstance(face.camera, Pinhole) for face in faces)
    assert warp(WIDE).blank(3).shape == (ends[-1], max(face.camera.width_px for face in faces), 3)
