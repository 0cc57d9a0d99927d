"""Textures have the values, the channels and the size that they were given."""

import numpy as np
import pytest

pytest.importorskip("OpenGL.GL")

from OpenGL import GL

from vobench.rendering.gl_texture import LightTexture, PanoramaTexture, SurfaceTexture, TiledLightTexture
from vobench.scene.material import linear
from vobench.scene.panorama import PanoramaMap

pytestmark = pytest.mark.usefixtures("gl_context")

COLOURS = np.arange(2 * 3 * 3, dtype=np.float32).reshape(2, 3, 3) / 8


def texels(pixel_format: int = GL.GL_RGBA) -> np.ndarray:
    """The texels (H, W, C) of the bound texture, as stored."""
    height = GL.glGetTexLevelParameteriv(GL.GL_TEXTURE_2D, 0, GL.GL_TEXTURE_HEIGHT)
    width = GL.glGetTexLevelParameteriv(GL.GL_TEXTURE_2D, 0, GL.GL_TEXTURE_WIDTH)
    GL.glPixelStorei(GL.GL_PACK_ALIGNMENT, 1)
    buffer = GL.glGetTexImage(GL.GL_TEXTURE_2D, 0, pixel_format, GL.GL_FLOAT)
    return np.frombuffer(buffer, np.float32).reshape(height, width, -1)


def test_a_light_map_is_stored_without_rounding() -> None:
    LightTexture(COLOURS)
    np.testing.assert_array_equal(texels(GL.GL_RGB), COLOURS)


def test_colours_with_equal_channels_are_stored_as_one() -> None:
    grey = COLOURS[..., 0]
    LightTexture(np.repeat(grey[..., None], 3, axis=2))
    assert GL.glGetTexLevelParameteriv(GL.GL_TEXTURE_2D, 0, GL.GL_TEXTURE_INTERNAL_FORMAT) == GL.GL_R32F
    np.testing.assert_array_equal(texels(GL.GL_RED)[..., 0], grey)
    swizzle = np.zeros(4, np.int32)
    GL.glGetTexParameteriv(GL.GL_TEXTURE_2D, GL.GL_TEXTURE_SWIZZLE_RGBA, swizzle)
    assert swizzle.tolist() == [GL.GL_RED, GL.GL_RED, GL.GL_RED, GL.GL_ONE]


def test_an_update_replaces_the_values_and_the_number_of_channels() -> None:
    texture = LightTexture(COLOURS[..., 0])
    texture.update(COLOURS)
    np.testing.assert_array_equal(texels(GL.GL_RGB), COLOURS)


def test_only_the_given_parts_of_a_tiled_light_map_are_replaced() -> None:
    texture = TiledLightTexture(3, 2)
    whole = (slice(0, 2), slice(0, 3))
    right = (slice(1, 2), slice(1, 3))
    texture.replace(COLOURS, [whole])
    texture.replace(COLOURS + 1, [right])
    expected = COLOURS.copy()
    expected[right] += 1
    np.testing.assert_array_equal(texels(GL.GL_RGB), expected)


def test_a_surface_is_stored_as_linear_values_and_opacity_as_it_is() -> None:
    values = np.array([[[0, 20, 255, 128], [255, 1, 60, 255]]], np.uint8)
    assert not SurfaceTexture(values).is_grey
    stored = texels()
    np.testing.assert_allclose(stored[..., :3], linear(values[..., :3]), atol=1 / 65535)
    np.testing.assert_allclose(stored[..., 3], values[..., 3] / 255, atol=1 / 65535)


def test_grey_values_above_1_are_scaled_down_and_the_scale_is_known() -> None:
    values = np.array([[0.5, 4.0], [1.0, 0.0]], np.float32)
    texture = SurfaceTexture(values)
    assert texture.is_grey
    assert texture.scale == 4.0
    np.testing.assert_allclose(texture.scale * texels(GL.GL_RED)[..., 0], values, atol=4 / 65535)


def test_halvings_reduce_a_surface_to_the_means_of_its_texels() -> None:
    values = np.array([[0.1, 0.3, 0.5, 0.7], [0.1, 0.3, 0.5, 0.7]], np.float32)
    SurfaceTexture(values, halvings=1)
    np.testing.assert_allclose(texels(GL.GL_RED)[..., 0], [[0.2, 0.6]], atol=1e-4)


def test_the_alpha_of_a_panorama_is_the_luminance_of_its_lamps() -> None:
    daylight = np.arange(4 * 8 * 3).reshape(4, 8, 3).astype(np.float16)
    lamps = np.arange(4 * 8).reshape(4, 8).astype(np.float16)
    PanoramaTexture(PanoramaMap(daylight, lamps))
    np.testing.assert_array_equal(texels()[..., :3], daylight)
    np.testing.assert_array_equal(texels()[..., 3], lamps)
